"""Bounds on the prediction error (Theorem 1) and their check on flights."""
