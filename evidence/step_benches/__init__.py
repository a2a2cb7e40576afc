"""Benches of the time step: observed orders, limits, cut frequency, refined bodies, the price list of a set."""
