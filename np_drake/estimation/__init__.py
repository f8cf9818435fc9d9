"""Estimation: noise, regression, fit, and priors of healthy vehicles."""
