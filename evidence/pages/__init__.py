"""Pages of docs/ made from the tables in the code."""
