"""Wrench estimators from the motion alone, as baselines of the predictor on the same flights."""
