"""A StageModel at rest and in motion: transmission error, simulation, traces."""
