"""`np-drake reproduce`: one table of the docs a verb."""
