"""Calibration: what a healthy vehicle differs by from its file, and flights from one another, in
every model.
"""
