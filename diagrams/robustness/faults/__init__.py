"""Flights with random faults of sensors, solver, rotors, payload and air, under every controller."""
