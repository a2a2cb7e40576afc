"""Shipped scenes: the TOML files of this folder."""
