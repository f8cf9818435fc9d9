"""Limits of vehicle, controller and arena on the track of a file."""

import numpy as np

from np_drake.mpc.problem import MpcConfig
from np_drake.references.base import Reference
from np_drake.references.flatness import targets
from np_drake.vehicle import Vehicle

RATE = 100.0  # at which the motion is looked at [Hz]
MOST_INSTANTS = 200_000  # that are looked at


def require_flyable(
    reference: Reference, vehicle: Vehicle, mpc: MpcConfig, *, end: float, arena: float, thrust: float
) -> None:
    """Check a motion up to its end against ground, arena, the controller's bounds and the rotors.

    Args:
        reference: motion of the file.
        vehicle: with the mass that it carries.
        mpc: bounds of speed and tilt.
        end: of the flight [s].
        arena: largest distance from the origin [m].
        thrust: real over nominal thrust [1].
    Raises: ValueError: at the first time at which one is passed.
    """
    t = np.linspace(0.0, end, min(int(end * RATE) + 2, MOST_INSTANTS))
    flat = reference.sample(t)
    p, speed = flat[0], np.abs(flat[1]).max(axis=1)
    force = flat[2] + [0.0, 0.0, vehicle.gravity]
    tilt = np.arccos(np.clip(force[:, 2] / np.maximum(np.linalg.norm(force, axis=1), 1e-9), -1.0, 1.0))
    _require(t, -p[:, 2], 0.0, "must stay above the ground; is {:.3g} m below it", "Raise its points.")
    _require(
        t,
        np.linalg.norm(p, axis=1),
        arena,
        f"must stay within {arena:g} m of the origin; is {{:.4g}} m away",
        "Move it.",
    )
    slower = "Take a lower speed, or more time between the rows."
    bound = f"must be within controller.mpc.max_speed, {mpc.max_speed:.3g} m/s; demands {{:.3g}} m/s"
    _require(t, speed, mpc.max_speed, bound, slower)
    rotors = targets(vehicle, flat, np.zeros((len(t), 6)))[1] @ vehicle.unmixer.T / thrust
    most, remedy = vehicle.max_rotor_thrust, "Take a lower speed, or smoother positions with more digits."
    bound = f"must be within max_rotor_thrust, {most:.3g} N; demands {{:.3g}} N of a rotor"
    _require(t, rotors.max(axis=1), most, bound, remedy)
    bound = f"must be within controller.mpc.max_tilt, {mpc.max_tilt:.3g} rad; demands {{:.3g}} rad"
    _require(t, tilt, mpc.max_tilt, bound, slower)
    _require(t, -rotors.min(axis=1), 0.0, "must pull no rotor down; demands {:.3g} N of one", remedy)


def _require(t: np.ndarray, values: np.ndarray, most: float, what: str, remedy: str) -> None:
    """Check that no value is beyond `most`."""
    beyond = values > most
    if beyond.any():
        k = int(np.argmax(beyond))
        raise ValueError(f"{what.format(values[k])} at {t[k]:.2f} s. {remedy}")
