"""HTTP in, bus out: jobs, events, meshes, metrics."""
