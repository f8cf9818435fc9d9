"""Offboard control by MAVLink: messages, readings, limits and the phases of a flight."""
