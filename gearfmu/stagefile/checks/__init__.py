"""What can be wrong with a stage, found once on the general stage, whatever kind of file it is from."""
