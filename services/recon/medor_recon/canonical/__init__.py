"""From a depth view to canonical coordinates at every pixel on the cloth."""
