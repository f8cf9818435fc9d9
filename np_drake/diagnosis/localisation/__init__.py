"""Localisation of the gap in channel, time, regime and frequency, and identifiability of effects
from the logs.
"""
