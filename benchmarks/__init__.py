"""Measurements over the bus: closed-loop tables, the wire, the solver."""
