"""Stage files from a few numbers, from another stage, or on half the element counts."""
