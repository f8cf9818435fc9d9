"""Direction, mean force and speed of a wind on a flight: as measured against still air, and as a diagnosis tells."""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from diagrams.challenge.real.flights import open_flights
from diagrams.challenge.real.payload_position import residual_force, wrench_of
from diagrams.challenge.real.truth import DIRECTION, WINDS
from np_drake.diagnosis.residuals.make_flight_residuals import make_flight_residuals
from np_drake.effects.base import Effect, WrenchEffect
from np_drake.effects.combine import split_effects
from np_drake.flight_log import FlightLog
from np_drake.vehicle import Vehicle

STEP = 0.02  # between the instants at which a force is averaged [s]


def measured_wind_force(windy: Sequence[Path], still: Sequence[Path], vehicle: Vehicle) -> np.ndarray:
    """Return the mean residual force of flights in wind less that of flights in still air, (3,) in W [N].

    Args:
        windy: logs of flights in wind.
        still: logs of flights in still air.
        vehicle: nominal vehicle.
    """

    def mean(paths: Sequence[Path]) -> np.ndarray:
        flights = [log for path in paths for log in open_flights(path, vehicle)]
        forces = [residual_force(make_flight_residuals(log, vehicle)) for log in flights]
        return np.mean([force.mean(axis=0) for force in forces], axis=0)

    return mean(windy) - mean(still)


def wind_figures(
    effects: Sequence[Effect],
    flights: Sequence[FlightLog],
    vehicle: Vehicle,
    measured: np.ndarray,
    speed: float,
    force: np.ndarray | None = None,
) -> dict[str, float]:
    """Return direction error [deg], mean force over that measured [1] and speed over that of the fans [1] of a wind.

    Empty where no wind is among the effects.

    Args:
        effects: wind, drags and what else acts.
        flights: flights in the wind, over which its force is averaged.
        vehicle: nominal vehicle.
        measured: (3,) mean force of the wind in W [N].
        speed: of the fans [m/s].
        force: (3,) mean force of the wind in W, where it is known [N]; None: that of the effects.
    """
    acting = split_effects(effects).wrench
    winds: list[Any] = [effect.predicted for effect in acting if effect.identifier in WINDS]
    if not winds:
        return {}
    if force is None:
        drags = [effect for effect in acting if effect.identifier not in WINDS]
        force = np.mean([_wind_force(log, vehicle, drags, winds) for log in flights], axis=0)
    wind = sum((w.air_velocity(0.0) for w in winds), np.zeros(3))
    return {
        "angle": angle(wind[:2], np.array(DIRECTION)),
        "force": float(force[:2] @ DIRECTION / (measured[:2] @ DIRECTION)),
        "speed": float(np.linalg.norm(wind[:2]) / speed),
        "up": float(wind[2]),
    }


def _wind_force(
    log: FlightLog, vehicle: Vehicle, drags: Sequence[WrenchEffect], winds: Sequence[WrenchEffect]
) -> np.ndarray:
    """Return the mean force of drags in wind less that of drags in still air, (3,) in W [N]."""
    t = log.t[:: max(1, int(STEP / log.step))]
    change = wrench_of(log, vehicle, [*drags, *winds], t) - wrench_of(log, vehicle, drags, t)
    return change[:, :3].mean(axis=0)


def angle(a: np.ndarray, b: np.ndarray) -> float:
    """Return the angle between two vectors [deg]; NaN where one is zero.

    Args:
        a: vector.
        b: vector of the same size.
    """
    size = float(np.linalg.norm(a) * np.linalg.norm(b))
    return math.degrees(math.acos(np.clip(float(a @ b) / size, -1, 1))) if size > 0 else math.nan
