"""Hard cases: scenes that break solvers, run at every level and at several steps, each with checks of its own."""
