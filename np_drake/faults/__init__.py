"""Faults of sensors and solvers, as pure functions of time, sample and seed."""
