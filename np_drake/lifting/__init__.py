"""Lifted linear systems: the model, its training, error bounds and prediction metrics."""
