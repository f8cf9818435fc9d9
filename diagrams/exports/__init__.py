"""Exports of a corrected vehicle, nominal model and effects, to other simulators."""
