"""Tables of scene files: drivetrain, loads on shafts, deformation."""
