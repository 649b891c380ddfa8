"""Data sets by the hour: crumpled garments seen from above, and what a pull does to them."""
