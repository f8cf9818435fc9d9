"""Experiments with a swinging or changing payload."""
