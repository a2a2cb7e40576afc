"""Room of the report: metrics, plots and the page of one run."""
