"""Sweeps: a scene or a stage at many points, on this machine's cores or on a dask cluster, into one table."""
