"""Cloth mesh and candidate actions in, rollouts and rewards out."""
