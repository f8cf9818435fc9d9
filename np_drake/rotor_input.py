"""Input that acts on the rotors: from measured rotor speed, or from the command through the vehicle
file's lag.
"""

import dataclasses as dc
import math

import numpy as np
import scipy

from np_drake.finding import Finding, Kind
from np_drake.flight_log import FlightLog
from np_drake.vehicle.vehicle import Vehicle


def with_rotor_input(log: FlightLog, vehicle: Vehicle) -> FlightLog:
    """Return the log with u from measured rotor speed and the vehicle file (`input: rotor_speed`).
    Raises: ValueError: where the log has no rotor columns.
    """
    if log.rotor is None:
        raise ValueError(
            f"with_rotor_input: {log.name} must have columns rotor1 … rotor4; got none."
        )
    text = f"thrust and torque from rotor speed and vehicle {vehicle.name!r} (input: rotor_speed)"
    finding = Finding(Kind.INPUT, "no command", text)
    u = rotor_wrench(vehicle, log.rotor)
    return dc.replace(log, u=u, input="rotor_speed", findings=[*log.findings, finding])


def acting_command(log: FlightLog, vehicle: Vehicle) -> np.ndarray:
    """Return the command that acts on the rotors at t_k by the vehicle file, right-sided, (n, 4)
    [N, N·m].

    Without lag: row k's command. With lag: rotor speed is continuous, so row k shows commands
    0 … k-1. Measured rotor speed (`log.input`) needs no lag.
    """
    decay = rotor_decay(vehicle, log.step)
    if decay == 0.0 or log.input == "rotor_speed":
        return log.u
    good = np.all(np.isfinite(log.u), axis=1)
    good[-1] = False  # the last command acts after the last row
    acting = np.full_like(log.u, np.nan)
    if not good.any():
        return acting
    target = rotor_speed(vehicle, log.u[good])
    speed, _ = scipy.signal.lfilter([1 - decay], [1, -decay], target, axis=0, zi=decay * target[:1])
    acting[1:][good[:-1]] = rotor_wrench(vehicle, speed)
    if np.all(np.isfinite(log.u[0])):
        acting[0] = log.u[0]
    return acting


def rotor_decay(vehicle: Vehicle, step: float) -> float:
    """Return exp(-step / rotor_time_constant), 0 without lag [1].

    Args:
        step: between samples [s].
    """
    return lag_shares(vehicle.rotor_time_constant, step)[1]


def with_rotor_lag(vehicle: Vehicle, lag: float) -> Vehicle:
    """Return the vehicle with this lag of its rotors [s]; one that its file names takes
    precedence.
    """
    return dc.replace(vehicle, rotor_time_constant=vehicle.rotor_time_constant or lag)


def lag_shares(time_constant: float, step: float) -> tuple[float, float]:
    """Return the share of a difference that a first-order lag leaves under a held command: mean
    over a step, and at its end [1].
    """
    if time_constant <= 0.0:
        return 0.0, 0.0
    decay = math.exp(-step / time_constant)
    return time_constant / step * (1.0 - decay), decay


def rotor_speed(vehicle: Vehicle, u: np.ndarray) -> np.ndarray:
    """Return the rotor speed (..., 4) that gives an input; no rotor pulls downwards [rad/s].

    Args:
        u: (..., 4) [f_u, tau_m], [N, N·m].
    """
    return np.sqrt(np.maximum(u @ vehicle.unmixer.T, 0.0) / vehicle.thrust_coefficient)


def rotor_wrench(vehicle: Vehicle, speed: np.ndarray) -> np.ndarray:
    """Return u = [f_u, tau_m] (..., 4) of rotor speeds [N, N·m].

    Args:
        speed: (..., 4) [rad/s].
    """
    return (vehicle.thrust_coefficient * np.square(speed)) @ vehicle.mixer.T
