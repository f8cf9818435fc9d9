"""The vehicle: its file, its rotors, its calibration and the vehicles that are published."""

from np_drake.vehicle.vehicle import Vehicle, load_vehicle

__all__ = ["Vehicle", "load_vehicle"]
