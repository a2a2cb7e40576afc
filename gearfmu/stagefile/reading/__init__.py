"""How the files of stages and scenes are read: tables with their bases, changes, quantities, all problems at once."""
