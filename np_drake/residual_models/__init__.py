"""Residual models: what predicts the wrench, for the prediction benchmark and for the MPC alike."""
