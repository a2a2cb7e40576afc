"""Rolling bearings after ISO/TS 16281: one potential of the displacement between the rings, forces, stiffness."""
