"""Lifted linear systems: the model, its training and error bounds."""
