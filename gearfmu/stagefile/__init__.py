"""Stage files as frozen typed objects, SI inside; all problems of a file are reported at once."""
