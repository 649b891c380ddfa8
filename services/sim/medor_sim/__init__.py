"""The simulated cell: PyBullet world, Panda arm, depth camera, cloth engine; the robot's endpoints."""
