"""Diagnosis of the sim-to-real gap: its causes, where it lies, and how far adding the causes closes it."""
