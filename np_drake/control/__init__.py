"""Cascaded controller, fast enough for hundreds of simulated flights."""
