"""Mean force of a wind on a flight: as measured against still air, and as a diagnosis tells."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from diagrams.challenge.real.flights import open_flights
from diagrams.challenge.real.payload_position import wrench_of
from np_drake.diagnosis.residuals.make_flight_residuals import make_flight_residuals
from np_drake.effects.base import WrenchEffect
from np_drake.effects.constant_wind import ConstantWind
from np_drake.effects.library import LIBRARY
from np_drake.flight_log import FlightLog
from np_drake.vehicle import Vehicle

Values = Mapping[str, float]


def mean_residual_force(log: FlightLog, vehicle: Vehicle) -> np.ndarray:
    """Return the mean force that the nominal model leaves, (3,) in W [N]."""
    e = make_flight_residuals(log, vehicle)
    return np.mean((e.R_WB @ e.y[:, :3, None])[..., 0], axis=0)


def measured_wind_force(windy: Sequence[Path], still: Sequence[Path], vehicle: Vehicle) -> np.ndarray:
    """Return the mean residual force of flights in wind less that of flights in still air, (3,) in W [N]."""
    means = [
        np.mean(
            [mean_residual_force(log, vehicle) for path in paths for log in open_flights(path, vehicle)],
            axis=0,
        )
        for paths in (windy, still)
    ]
    return means[0] - means[1]


def steady_wind(causes: Mapping[str, Values]) -> np.ndarray | None:
    """Return the mean velocity (3,) in W of the wind among causes [m/s]; None where there is none."""
    found = [np.array([causes["constant_wind"][i] for i in "xyz"])] if "constant_wind" in causes else []
    if "gusty_wind" in causes:
        found.append(np.array([causes["gusty_wind"][f"mean_{i}"] for i in "xyz"]))
    return sum(found[1:], found[0]) if found else None


def told_wind_force(
    causes: Mapping[str, Values], flights: Sequence[FlightLog], vehicle: Vehicle
) -> np.ndarray:
    """Return the mean force of the wind among causes on flights, (3,) in W [N]: drags in wind less drags in still air.

    Args: causes: parameters by name of effect; a wind without a drag has no force.
    """
    wind = steady_wind(causes)
    if wind is None:
        return np.zeros(3)
    drags = wrench_effects(
        {name: values for name, values in causes.items() if name not in ("constant_wind", "gusty_wind")}
    )
    blown = [*drags, ConstantWind(*wind.tolist())]
    means = []
    for log in flights:
        t = log.t[:: max(1, int(0.02 / log.step))]
        change = wrench_of(log, vehicle, blown, t) - wrench_of(log, vehicle, drags, t)
        means.append(change[:, :3].mean(axis=0))
    return np.mean(means, axis=0)


def wrench_effects(causes: Mapping[str, Values]) -> list[WrenchEffect]:
    """Return the wrench effects among causes, without payload and wind."""
    kinds = {name: LIBRARY.get(name) for name in causes}
    return [
        kind.of({p.name: causes[name][p.name] for p in kind.parameters if p.name in causes[name]})  # type: ignore[misc]
        for name, kind in kinds.items()
        if kind is not None and issubclass(kind, WrenchEffect) and name != "suspended_payload"
    ]
