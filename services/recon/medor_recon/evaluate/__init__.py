"""How good reconstruction is, on garments and states it has never seen."""
