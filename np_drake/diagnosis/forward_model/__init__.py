"""Predicted residual of effects with given parameters."""
