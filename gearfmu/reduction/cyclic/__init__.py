"""Reduction of gears meshed here, by one sector of their cyclic symmetry."""
