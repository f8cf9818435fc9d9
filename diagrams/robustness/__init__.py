"""Sweeps over payload, tether, speed, wind, noise and motor lag."""
