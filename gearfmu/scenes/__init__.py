"""Shipped scenes (TOML files of this folder) and builders of scenes that tests and benchmarks share."""
