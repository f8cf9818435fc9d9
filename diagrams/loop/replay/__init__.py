"""Stand-alone 3-D pages that play a flight."""
