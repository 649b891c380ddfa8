"""The real cell: Franka arm, depth camera, calibration, safety; the robot's endpoints."""
