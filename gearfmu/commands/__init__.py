"""The command line's verbs: thin callers of the packages above, one file a family."""
