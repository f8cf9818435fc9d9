"""Vehicles, tracks and rows of the study."""

from functools import cache

from diagrams.tracking.tracking import ROWS as TRACKING_ROWS
from diagrams.tracking.tracking import named
from np_drake.vehicle import Vehicle, load_vehicle
from np_drake.vehicle.estimate import Measured, estimate

TRACKS = ("circle", "fast_lemniscate", "steps", "vertical")  # experiments that are flown
VEHICLES = ("35g", "paper", "6kg")  # that fly, in ascending order of mass
# Rows of the tracking comparison that are flown.
SHOWN = ("nominal", "hold", "hold + total mass", "np", "payload_filter", "oracle")
ROWS = tuple(named(TRACKING_ROWS, name) for name in SHOWN)
# Measures of a 6 kg vehicle. Source: published diagonal wheelbase and 21-inch propellers of the DJI
# Matrice 300 RTK; own choice: the mass, and a hover throttle of 0.7, hence a thrust of twice the
# weight.
SIX_KILOGRAMS = Measured(mass=6.0, wheelbase=0.895, propeller=0.5334, hover_throttle=0.7)


@cache
def fleet() -> dict[str, Vehicle]:
    """Return the vehicles by their names, `VEHICLES`."""
    return {
        "35g": load_vehicle("crazyflie").with_mass(0.035),
        "paper": load_vehicle("paper"),
        "6kg": estimate(SIX_KILOGRAMS, "6kg"),
    }
