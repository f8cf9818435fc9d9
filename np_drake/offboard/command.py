"""Collective thrust and body rates as an autopilot takes them."""

import numpy as np

from np_drake import attitude
from np_drake.vehicle import Vehicle
from np_drake.vehicle.vehicle import RateLoop, ThrottleMap

# share by which a battery's voltage may differ from that of the map [1]; source: own choice
BELIEVED = 0.3
TURN = 4.0  # body rate over the error of tilt [1/s]; source: own choice


def throttle_of(vehicle: Vehicle, thrust: float, voltage: float | None = None) -> float:
    """Return the thrust of SET_ATTITUDE_TARGET, over that at full throttle [1].

    By the vehicle file's thrust map; linear in thrust where the file names none.

    Args:
        thrust: collective [N].
        voltage: of the battery [V]; None, or one that is far from the map's: the map's own.
    """
    return float(np.clip(_map(vehicle).throttle(thrust / 4, _believed(vehicle, voltage)), 0.0, 1.0))


def thrust_of(vehicle: Vehicle, throttle: float, voltage: float | None = None) -> float:
    """Return the collective thrust [N] of SET_ATTITUDE_TARGET's, the inverse of `throttle_of`.

    Args:
        throttle: [1].
        voltage: of the battery [V]; None, or one that is far from the map's: the map's own.
    """
    return 4 * float(_map(vehicle).thrust(throttle, _believed(vehicle, voltage)))


def rates_towards(q: np.ndarray, z_W: np.ndarray, loop: RateLoop) -> np.ndarray:
    """Return the commanded body rates (3,) that turn body z to a direction, within the loop's
    largest [rad/s].

    Args:
        q: (4,) attitude.
        z_W: (3,) in W, of any length.
    """
    z_B = attitude.rotate_back(q, z_W / np.linalg.norm(z_W))
    axis = np.array([-z_B[1], z_B[0], 0.0])  # body z x z_B
    sine = float(np.linalg.norm(axis))
    angle = float(np.arctan2(sine, z_B[2]))
    turn = (
        axis * (angle / sine) if sine > 1e-9 else np.array([angle, 0.0, 0.0])
    )  # upside down any axis does
    most = np.array(loop.max_rate)
    return np.clip(TURN * turn / np.array(loop.gain), -most, most)


def _map(vehicle: Vehicle) -> ThrottleMap:
    return vehicle.throttle or ThrottleMap(full_thrust=vehicle.max_rotor_thrust, linear=1.0)


def _believed(vehicle: Vehicle, voltage: float | None) -> float | None:
    own = _map(vehicle).voltage
    return (
        voltage
        if voltage is not None and own is not None and abs(voltage / own - 1) <= BELIEVED
        else None
    )
