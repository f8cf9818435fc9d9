"""Sweeps over payload, motion, air, sensors and actuators, their joint grid, and margins of delay
and gain.
"""
