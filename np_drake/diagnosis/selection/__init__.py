"""Search over sets of effects, change points and model ranking."""
