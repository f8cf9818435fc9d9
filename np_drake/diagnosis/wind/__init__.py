"""Slow forces: gusts, wind onsets, and what resembles them."""
