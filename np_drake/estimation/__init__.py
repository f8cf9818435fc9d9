"""Wrench estimators that know the motion only: peers of the predictor, measured on the same flights."""
