"""Finite elements made elsewhere before reduction: gears, rings, carriers."""
