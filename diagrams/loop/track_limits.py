"""Limits of vehicle, controller and arena on the track of a file."""

import numpy as np

from np_drake.mpc.problem import MpcConfig
from np_drake.references.base import Reference
from np_drake.references.config import ReferenceConfig
from np_drake.references.flatness import targets
from np_drake.references.waypoints import nearest, off_legs
from np_drake.vehicle import Vehicle

MOST_TOLD = 5  # waypoints in a sentence
RATE = 100.0  # at which the motion is looked at [Hz]
MOST_INSTANTS = 200_000  # that are looked at


def require_flyable(
    reference: Reference,
    vehicle: Vehicle,
    mpc: MpcConfig,
    *,
    end: float,
    arena: float,
    thrust: float,
) -> None:
    """Check a motion up to its end against ground, arena, the controller's bounds and the rotors.

    Args:
        end: of the flight [s].
        arena: largest distance from the origin [m].
        thrust: real over nominal thrust [1].
    Raises: ValueError: at the first time at which one is passed.
    """
    t = np.linspace(0.0, end, min(int(end * RATE) + 2, MOST_INSTANTS))
    flat = reference.sample(t)
    p, speed = flat[0], np.abs(flat[1]).max(axis=1)
    force = flat[2] + [0.0, 0.0, vehicle.gravity]
    tilt = np.arccos(
        np.clip(force[:, 2] / np.maximum(np.linalg.norm(force, axis=1), 1e-9), -1.0, 1.0)
    )
    _require(
        t, -p[:, 2], 0.0, "must stay above the ground; is {:.3g} m below it", "Raise its points."
    )
    _require(
        t,
        np.linalg.norm(p, axis=1),
        arena,
        f"must stay within {arena:g} m of the origin; is {{:.4g}} m away",
        "Move it.",
    )
    slower = "Take a lower speed, or more time between the rows."
    bound = (
        f"must be within controller.mpc.max_speed, {mpc.max_speed:.3g} m/s; demands {{:.3g}} m/s"
    )
    _require(t, speed, mpc.max_speed, bound, slower)
    rotors = targets(vehicle, flat, np.zeros((len(t), 6)))[1] @ vehicle.unmixer.T / thrust
    most, remedy = (
        vehicle.max_rotor_thrust,
        "Take a lower speed, or smoother positions with more digits.",
    )
    bound = f"must be within max_rotor_thrust, {most:.3g} N; demands {{:.3g}} N of a rotor"
    _require(t, rotors.max(axis=1), most, bound, remedy)
    bound = f"must be within controller.mpc.max_tilt, {mpc.max_tilt:.3g} rad; demands {{:.3g}} rad"
    _require(t, tilt, mpc.max_tilt, bound, slower)
    _require(
        t, -rotors.min(axis=1), 0.0, "must pull no rotor down; demands {:.3g} N of one", remedy
    )


def warnings(config: ReferenceConfig, track: Reference, *, end: float) -> list[str]:
    """Return a sentence on the waypoints that a track does not pass, and one on how far it leaves
    their legs.

    Args:
        config: with the waypoints, and the distance that is allowed.
        end: of the flight [s].
    """
    points = config.waypoints
    if points is None:
        return []
    p = track.sample(np.linspace(0.0, end, min(int(end * RATE) + 2, MOST_INSTANTS)))[0]
    said = missed(nearest(points, p), config.within, "the track")
    off, leg = off_legs(points, p)
    if config.is_file and off > config.within:
        said.append(
            f"the track leaves the straight leg from waypoint {leg + 1} to {leg + 2} by "
            f"{off:.2f} m; "
            "reference.corners: stop keeps to the legs."
        )
    return said


def missed(distances: np.ndarray, within: float, who: str) -> list[str]:
    """Return a sentence on the waypoints that were not passed within a distance; none where all
    were.

    Args:
        distances: how near each was passed (k,) [m].
        within: the distance [m].
    """
    rows = np.flatnonzero(distances > within)
    if not len(rows):
        return []
    told = ", ".join(f"{k + 1} ({distances[k]:.2f} m)" for k in rows[:MOST_TOLD])
    more = f" and {len(rows) - MOST_TOLD} more" if len(rows) > MOST_TOLD else ""
    many = "waypoint" if len(rows) == 1 else "waypoints"
    return [f"{who} does not come within {within:g} m of {many} {told}{more}."]


def _require(t: np.ndarray, values: np.ndarray, most: float, what: str, remedy: str) -> None:
    """Check that no value is beyond `most`."""
    beyond = values > most
    if beyond.any():
        k = int(np.argmax(beyond))
        raise ValueError(f"{what.format(values[k])} at {t[k]:.2f} s. {remedy}")
