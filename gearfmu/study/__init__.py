"""What accuracy costs: error against time of the fidelity levels, observed orders, limits of the step."""
