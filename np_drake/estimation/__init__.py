"""Estimation: noise, regression and fit, which identification and diagnosis share."""
