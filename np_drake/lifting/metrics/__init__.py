"""Prediction skill, response lag and tether length of trained predictors."""
