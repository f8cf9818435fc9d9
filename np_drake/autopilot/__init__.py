"""Autopilots beside a vehicle: MAVLink, readings, limits, phases of a flight, and firmware."""
