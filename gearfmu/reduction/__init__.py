"""Reduction of a free gear body: elastic modes, static compliance tables, frequency response error."""
