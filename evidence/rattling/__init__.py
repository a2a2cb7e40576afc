"""Free and lightly loaded rattle of a pair: scenes of the conservation tests and of the integrators' comparison."""
