"""Depth image of a garment in, its cloth mesh out."""
