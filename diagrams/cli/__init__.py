"""The command line `np-drake`: one verb a file."""
