"""Flights through an autopilot's firmware, and what they are measured by."""
