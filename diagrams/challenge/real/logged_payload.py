"""Position of the payload that a Crazyflie log holds: truth for scores, never an input."""

from pathlib import Path

import numpy as np
from scipy.optimize import minimize_scalar

from np_drake.flight_log import FlightLog
from np_drake.logs.errors import LogError
from np_drake.logs.formats import crazyflie
from np_drake.logs.importing.signals import Signal

MILLIMETRE = 1e-3  # [m]
PAYLOAD = tuple(f"stateEstimateZ.p{axis}" for axis in "xyz")  # [mm]
VEHICLES = (  # with the unit of each [m]
    (tuple(f"stateEstimate.{axis}" for axis in "xyz"), 1.0),
    (tuple(f"stateEstimateZ.{axis}" for axis in "xyz"), MILLIMETRE),
)


def logged_payload(path: Path, flight: FlightLog) -> tuple[np.ndarray, np.ndarray]:
    """Return the times (n,) [s], on the clock of a flight of this log, and p_WPo of the payload (n,
    3) [m].

    Repeated values are left out: the log holds a slower stream on faster rows. The clock of the
    flight starts at take-off, at the time where its positions are those of the log.
    Raises: LogError: if the log holds no payload, or the flight is not of this log.
    """
    found = (
        (event, own, unit)
        for event, names in crazyflie.contents(path).items()
        for own, unit in VEHICLES
        if set(PAYLOAD + own) <= set(names)
    )
    event, own, unit = next(found, ("", (), 0.0))
    if not event:
        raise LogError(
            f"{path}: must hold {', '.join(PAYLOAD)}; it holds no position of a payload."
        )
    stream = crazyflie.read(path, {event: [*PAYLOAD, *own]}, lambda share: None).streams[event]
    p = MILLIMETRE * np.stack([stream.columns[name] for name in PAYLOAD], axis=1)
    p_WB = unit * np.stack([stream.columns[name] for name in own], axis=1)
    new = np.concatenate([[True], np.any(np.diff(p, axis=0) != 0, axis=1)])
    begin = _begin(stream.t, p_WB, flight)
    return stream.t[new] - begin, p[new]


def _begin(t: np.ndarray, p_WB: np.ndarray, flight: FlightLog) -> float:
    """Return the time on the clock of the log at which a flight's clock is zero [s]."""
    rows = slice(0, len(flight), max(1, len(flight) // 400))

    def off(begin: float) -> float:
        there = Signal(t, p_WB).linear(begin + flight.t[rows])
        return float(np.mean(np.sum((there - flight.p[rows]) ** 2, axis=1)))

    tries = np.arange(t[0], max(t[-1] - flight.t[-1], t[0]) + 0.02, 0.01)
    near = min(tries, key=off)
    found = minimize_scalar(
        off, bounds=(near - 0.02, near + 0.02), method="bounded", options={"xatol": 1e-5}
    )
    if found.fun > 0.01**2:
        raise LogError(
            f"{flight.name}: must be a flight of the log; positions are "
            f"{found.fun**0.5:.2g} m apart."
        )
    return float(found.x)
