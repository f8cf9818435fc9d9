"""Models on flights to which they were not fitted."""
