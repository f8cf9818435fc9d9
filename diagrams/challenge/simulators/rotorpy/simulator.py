"""The simulator `rotorpy`: an exact log of one planned flight with effects, independent of how a diagnosis sees them.

Rigid body, rotors and motors are rotorpy's; other effects are written anew in this folder. Only the identifier
and the parameters of an effect are read.   Source: Folk, Paulos and Kumar 2023 (RotorPy), as a library.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np

from diagrams.challenge.simulators.flight_plan import Plan, require_flying
from diagrams.challenge.simulators.rotorpy.closed_loop import Flight
from diagrams.challenge.simulators.rotorpy.library_effects import ActiveEffect, read_effect
from diagrams.challenge.simulators.rotorpy.sensors import ERRORS, with_sensor_errors
from diagrams.challenge.simulators.rotorpy.vehicle import GAINS, LAWS, STATEFUL, RealMultirotor
from np_drake.flight_log import FlightLog
from np_drake.vehicle import Vehicle

WARM_UP = 4.0  # hovering before the first row, in which integrators settle [s]
# Effects that are parameters of rotorpy's, or have a place of their own.
_OWN_PLACE = [
    *("mass_error", "inertia_error", "center_of_mass_offset", "thrust_scale", "motor_lag", "command_delay"),
    *("constant_wind", "gusty_wind", "ground_effect", "suspended_payload", "clock_offset"),
]
KNOWN = frozenset([*_OWN_PLACE, *LAWS, *GAINS, *STATEFUL, *ERRORS])


def fly(
    vehicle: Vehicle,
    plan: Plan,
    effects: Sequence[Any] = (),
    *,
    t: np.ndarray,
    onset: float | None = None,
    background: Sequence[Any] = (),
) -> FlightLog:
    """Return the exact log of Bo: no noise; systematic sensor effects and the right-sided accelerations are in it.

    Args:
        t: (n,) instants of the rows [s]; the command is updated there too.
        onset: the effects act from the first row at or after it on [s], errors of sensors throughout; None: from the
            start.
        background: effects that act throughout and are no cause (a vehicle file that is a percent off).
    Raises: FailedRun: if the vehicle is lost; ValueError: on an effect that this simulator does not know.
    """
    added, always = read_effects(effects), read_effects(background)
    offset = sum(a.values["offset"] for a in added if a.name == "clock_offset")
    rows = instants(t, max(offset, 0.0))
    split = 0 if onset is None else int(np.searchsorted(rows, onset - 1e-9))
    first = RealMultirotor(vehicle, [*always, *added] if split == 0 else always)
    x = np.concatenate([plan.start(vehicle.gravity), np.zeros(6)])
    flight = Flight(vehicle, first, rows[0], x)
    later = RealMultirotor(vehicle, [*always, *added]) if split else None
    commands, states = _fly_rows(flight, plan.targets(vehicle.gravity, rows), rows, t + offset, split, later)
    start = int(np.searchsorted(rows, t[0] - 1e-9))
    u, speed = commands[start : start + len(t), :4], commands[start : start + len(t), 4:]
    p, q, v, w, a, al = np.split(states, [3, 7, 10, 13, 16], axis=1)
    return with_sensor_errors(FlightLog(t, p, q, v, w, u, a, al, speed), added)


def read_effects(effects: Sequence[Any]) -> list[ActiveEffect]:
    """Return the effects as read here. Raises ValueError: if one is unknown, or there are two payloads."""
    acting = [read_effect(effect) for effect in effects]
    for a in acting:
        if a.name not in KNOWN:
            raise ValueError(f"rotorpy: an effect must be one of {', '.join(sorted(KNOWN))}; got {a.name!r}.")
    if sum(a.name == "suspended_payload" for a in acting) > 1:
        raise ValueError("rotorpy: there must be one suspended_payload at most; got two.")
    return acting


def instants(t: np.ndarray, margin: float) -> np.ndarray:
    """Return the rows (m,) [s]: those before the log, its own, and those after until its last state has been read."""
    step = float(np.median(np.diff(t)))
    before = t[0] - step * np.arange(round(WARM_UP / step), 0, -1)
    return np.concatenate([before, t, t[-1] + step * np.arange(1, 2 + int(np.ceil(margin / step)))])


def _fly_rows(
    flight: Flight,
    targets: np.ndarray,
    rows: np.ndarray,
    reads: np.ndarray,
    split: int,
    later: RealMultirotor | None,
) -> tuple[np.ndarray, np.ndarray]:
    """Return (m - 1, 8) command and rotor speed at all rows but the last, (n, 19) states at `reads`."""
    commands: list[np.ndarray] = []
    states: list[np.ndarray] = []
    for k, target in enumerate(targets[:-1]):
        if later is not None and k == split:
            flight.change(later)
        u = flight.control(target)
        commands.append(np.concatenate([u, flight.speed]))
        if not k % 10:
            require_flying(flight.state(), target, flight.t)
        while len(states) < len(reads) and reads[len(states)] < rows[k + 1] - 1e-9:
            flight.advance(reads[len(states)])
            states.append(flight.reading())
        flight.advance(rows[k + 1])
    return np.array(commands), np.array(states)
