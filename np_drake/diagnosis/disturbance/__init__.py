"""What no effect describes: generic structure that competes with the best model for the same evidence."""
