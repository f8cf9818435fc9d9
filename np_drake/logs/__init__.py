"""Flight logs: one format a file, one in-memory form."""
