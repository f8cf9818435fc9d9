"""Residual models: predictors of the wrench, used by the prediction benchmark and by the MPC."""
