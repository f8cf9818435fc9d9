"""Lifted linear systems: encoders, Algorithm 1, model files, excitation and prediction skill."""
