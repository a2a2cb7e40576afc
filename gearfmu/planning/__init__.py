"""Which effects, level, step and slices a scene needs for an error budget: chosen by formulas and cheap trial runs,
written to plan.toml, run with tripwires, and verified."""
