"""Vehicles of other sizes on several tracks, each trained on a flight of its own."""
