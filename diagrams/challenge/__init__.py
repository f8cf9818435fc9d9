"""Withheld-effect challenge sets: flights with an effect that whoever diagnoses them is not told."""
