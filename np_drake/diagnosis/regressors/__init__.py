"""Columns of the linear model: library effects, generic structure, nuisance, payload."""
