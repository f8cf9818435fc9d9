"""Identification of a vehicle from flight logs."""
