"""Withheld-effect challenge sets: flights with an effect that a diagnosis does not know."""
