"""Coupling: units, masters, drivetrain parts and the run of a scene."""
