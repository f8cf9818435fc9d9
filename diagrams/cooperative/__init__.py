"""Several vehicles on one payload."""
