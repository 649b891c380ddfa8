"""What cloth is: garments, the cloth solver, depth rasteriser, coverage and normalized improvement."""
