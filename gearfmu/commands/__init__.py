"""Room of the command line's verbs: thin callers of the rooms above, one file a family."""
