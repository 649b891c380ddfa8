"""Task and mesh in, the pick-and-place with the best predicted reward out; closed-loop episodes."""
