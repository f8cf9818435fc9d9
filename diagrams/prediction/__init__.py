"""Experiments on prediction accuracy and estimation."""
