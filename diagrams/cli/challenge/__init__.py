"""`np-drake challenge`: one verb a file."""
