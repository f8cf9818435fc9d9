"""Payload filter: a bank of Kalman filters of a tethered payload that predicts the residual
wrench.
"""
