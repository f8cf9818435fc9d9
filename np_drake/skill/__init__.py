"""Prediction skill on held-out flights, its baselines, and how far behind the label a prediction
is.
"""
