"""Numerical methods without any knowledge of flights."""
