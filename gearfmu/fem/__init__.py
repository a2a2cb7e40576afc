"""Finite elements: stiffness and mass of 20-node hexahedra, averaging couplings, cyclic symmetry, eigenmodes."""
