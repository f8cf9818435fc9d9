"""The whole story in one run."""
