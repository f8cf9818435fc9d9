"""Grey-box model of a quadrotor: specific force, angular acceleration and rotor speed from what turns its rotors.

All wrenches are per mass, so that a flight tells thrust over mass and inertia over mass. Axes are those of the vehicle
file, with Bo as origin. Channels are measured less predicted values of a bin:
    0-2 specific force [m/s²]    3-5 angular acceleration [rad/s²]    6-9 rotor speed over hover speed [1]
The last four exist where a log holds rotor speed and throttle.
Source: Newton and Euler for a rigid body whose sensors, rotors and centre of mass are not at Bo.
"""

import dataclasses as dc
from functools import cached_property

import numpy as np

from np_drake.identification.rotor_response import at, lagged, means, target_speed
from np_drake.identification.signals import Signals

G = 9.81  # [m/s²]
FORCE, TORQUE, SPEED = slice(0, 3), slice(3, 6), slice(6, 10)
Values = dict[str, float]
RESPONSE = ("lag", "lag_ratio", "curve", "sag")  # of a rotor to its command


@dc.dataclass(frozen=True)
class Frame:
    """What is given of the vehicle: geometry and units of length.

    positions: (4, 3) rotors from Bo [m].   directions: (4,) signs of their reaction torques.   radius: of a rotor [m].
    unit: of inputs in hover: rotor speed [rad/s], throttle [1] or thrust [N] of one rotor.   volts: reference [V].
    throttle: throttle in hover [1].
    """

    positions: np.ndarray
    directions: np.ndarray
    radius: float
    unit: float
    volts: float = 0.0
    throttle: float = 0.0

    @cached_property
    def arm(self) -> float:
        """Mean distance of the rotors from their middle [m]."""
        return float(np.linalg.norm(self.positions - self.positions.mean(axis=0), axis=1).mean())

    @cached_property
    def patterns(self) -> np.ndarray:
        """(3, 4) unit differences between rotors: left to right, front to rear, by direction."""
        p = self.positions - self.positions.mean(axis=0)
        rows = np.stack([p[:, 1], p[:, 0], self.directions])
        return rows / np.abs(rows).max(axis=1, keepdims=True)


class FlightModel:
    """Residual channels of one flight, with the rotors' response kept while its parameters stay.

    Args:
        flight: signals of the flight.
        frame: what is given of the vehicle.
    """

    def __init__(self, flight: Signals, frame: Frame):
        self.flight, self.frame = flight, frame
        self._kept: dict[str, tuple] = {}
        self._relative = flight.input / frame.unit
        self.channels = 10 if flight.command is not None else 6

    def residual(self, v: Values) -> np.ndarray:
        """Return the channels (m, 6 or 10), measured less predicted.

        Args:
            v: parameters by name.
        """
        s, frame = self.flight, self.frame
        speed, thrust, late, change = self._rotors(v)
        gains = 1.0 + np.array([v["gain_roll"], v["gain_pitch"], v["gain_yaw"]]) @ frame.patterns
        per_mass = 0.25 * G * v["scale"]
        f = thrust * (per_mass * gains)
        center = frame.arm * np.array([v["com_x"], v["com_y"], 0.0])
        arms = frame.positions - center
        j = inertia(v) * frame.arm**2
        tilt = np.array([v["tilt_x"], v["tilt_y"], v["tilt_z"]])
        w, alpha = s.rate + np.cross(tilt, s.rate), s.alpha + np.cross(tilt, s.alpha)
        torque = np.empty((len(s), 3))
        torque[:, 0], torque[:, 1] = f @ arms[:, 1], -(f @ arms[:, 0])
        torque[:, 2] = f @ (frame.directions * v["torque"] * frame.radius)
        # Angular momentum of the rotors, which turn against their reaction torques.
        momentum = _momentum(v, frame)
        h = momentum * (speed @ frame.directions)
        torque[:, 0] += w[:, 1] * h
        torque[:, 1] -= w[:, 0] * h
        torque[:, 2] += momentum * (change @ frame.directions)
        air = self._air(v)
        torque += np.cross(-center, air)
        if s.velocity is not None:
            torque[:, 0] -= frame.arm * v["flap_y"] * s.velocity[:, 1]
            torque[:, 1] += frame.arm * v["flap_x"] * s.velocity[:, 0]
        torque -= euler(s.spread, j)
        e = np.empty((len(s), self.channels))
        e[:, TORQUE] = alpha - torque @ np.linalg.inv(j).T
        # The accelerometer may be stamped later than the gyro.
        push = air
        push[:, 2] += late @ (per_mass * gains)
        place = _imu(v, frame) - center
        late_alpha = self._alpha(v["force_late"])
        push += np.cross(late_alpha + np.cross(tilt, late_alpha), place) + s.spread @ place - np.trace(s.spread, axis1=1, axis2=2)[:, None] * place
        bias = np.array([v["bias_x"], v["bias_y"], v["bias_z"]])
        e[:, FORCE] = s.force - (push - np.cross(tilt, push) + bias)
        if self.channels == 10:
            e[:, SPEED] = self._measured_speed - self._predicted_speed(v)
        return e

    def _air(self, v: Values) -> np.ndarray:
        """Return the force of the air (m, 3) against the velocity, at Bo and over the mass [m/s²]."""
        out, u = np.zeros((len(self.flight), 3)), self.flight.velocity
        if u is not None:
            out[:, :2] = -v["drag"] * u[:, :2]
            out[:, 2] = v["lift"] * np.sum(u[:, :2] ** 2, axis=1) - v["climb"] * u[:, 2]
        return out

    def _alpha(self, late: float) -> np.ndarray:
        """Return the angular acceleration (m, 3) in the sensor's axes by which the accelerometer is late [rad/s²]."""
        if self._kept.get("alpha", (None,))[0] != late:
            s = self.flight
            edges = s.instants - late
            rates = np.stack([np.interp(edges, s.t, column) for column in s.smooth.T], axis=1)
            self._kept["alpha"] = (late, np.diff(rates, axis=0) / np.diff(edges)[:, None])
        return self._kept["alpha"][1]

    def _rotors(self, v: Values) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Return mean speed, mean thrust, mean thrust at the accelerometer's time, and change of speed in the bins."""
        driven = () if self.flight.drive == "rotor_speed" else RESPONSE
        late = v["clock"] if self.flight.drive == "rotor_speed" else v["delay"]
        key = (late, v["force_late"], *(v[name] for name in driven))
        if self._kept.get("rotors", (None,))[0] != key:
            t, speed = self._measured if self.flight.drive == "rotor_speed" else self._driven(v)
            edges = self.flight.instants - self.flight.t[0] - late
            square = speed * speed
            ends = at(t, speed, edges)
            self._kept["rotors"] = (
                key,
                means(t, speed, edges),
                means(t, square, edges),
                means(t, square, edges - v["force_late"]),
                np.diff(ends, axis=0) / np.diff(edges)[:, None],
            )
        return self._kept["rotors"][1:]

    def _driven(self, v: Values) -> tuple[np.ndarray, np.ndarray]:
        """Return the relative speeds (k, 4) at the edges of the fine grid (k,) [s] by the command, without dead time."""
        key = tuple(v[name] for name in (*RESPONSE, "full_speed"))
        if self._kept.get("driven", (None,))[0] != key:
            s, grid = self.flight, self.flight.substeps
            if s.drive == "command":
                wanted = np.sqrt(self._relative)
            else:
                throttle = s.input if s.command is None else s.command
                wanted = target_speed(throttle, v["curve"]) / target_speed(np.array(self.frame.throttle), v["curve"])
                wanted = v["full_speed"] * wanted
            if s.voltage is not None and self.frame.volts > 0:
                wanted = wanted * ((s.voltage / self.frame.volts) ** (0.5 * v["sag"]))[:, None]
            speed = lagged(np.ascontiguousarray(wanted), grid.row, grid.step, v["lag"], v["lag"] * v["lag_ratio"])
            self._kept["driven"] = (key, np.append(grid.t, grid.t[-1] + grid.step) - s.t[0], speed)
        return self._kept["driven"][1:]

    @cached_property
    def _measured(self) -> tuple[np.ndarray, np.ndarray]:
        """Measured relative speeds (k, 4) on the fine grid (k,) [s]."""
        grid, own = self.flight.substeps, self.flight.t - self.flight.t[0]
        t = np.append(grid.t, grid.t[-1] + grid.step) - self.flight.t[0]
        return t, np.stack([np.interp(t, own, column) for column in self._relative.T], axis=1)

    @cached_property
    def _measured_speed(self) -> np.ndarray:
        t, speed = self._measured
        return means(t, speed, self.flight.instants - self.flight.t[0])

    def _predicted_speed(self, v: Values) -> np.ndarray:
        """Return the relative rotor speeds (m, 4) that the throttle gives, as telemetry tells them.

        Telemetry runs ahead of the body's sensors by the clock.
        """
        key = (*(v[name] for name in (*RESPONSE, "full_speed")), v["delay"], v["clock"])
        if self._kept.get("speed", (None,))[0] != key:
            t, speed = self._driven(v)
            self._kept["speed"] = (key, means(t, speed, self.flight.instants - self.flight.t[0] - v["delay"] + v["clock"]))
        return self._kept["speed"][1]


def _gains(v: Values, frame: Frame) -> np.ndarray:
    """Return the gains (4,) of the rotors [1]."""
    return 1.0 + np.array([v["gain_roll"], v["gain_pitch"], v["gain_yaw"]]) @ frame.patterns


def _center(v: Values, frame: Frame) -> np.ndarray:
    """Return the centre of mass (3,) from Bo [m]."""
    return frame.arm * np.array([v["com_x"], v["com_y"], 0.0])


def _imu(v: Values, frame: Frame) -> np.ndarray:
    """Return the accelerometer (3,) from Bo [m]."""
    return frame.arm * np.array([v["imu_x"], v["imu_y"], v["imu_z"]])


def _momentum(v: Values, frame: Frame) -> float:
    """Return the angular momentum of a rotor in hover over the mass [m²/s]."""
    return v["rotor_momentum"] * v["jzz"] * (v["jxx"] + v["jyy"]) * frame.arm**2


def inertia(v: Values) -> np.ndarray:
    """Return the inertia (3, 3) over mass and squared arm [1].

    Args:
        v: parameters by name.
    """
    mean = 0.5 * (v["jxx"] + v["jyy"])
    xy, xz, yz = (-mean * v[name] for name in ("jxy", "jxz", "jyz"))
    return np.array([[v["jxx"], xy, xz], [xy, v["jyy"], yz], [xz, yz, v["jzz"] * (v["jxx"] + v["jyy"])]])


def euler(spread: np.ndarray, j: np.ndarray) -> np.ndarray:
    """Return the mean of w x j w (m, 3).

    Args:
        spread: (m, 3, 3) means of w w'.
        j: (3, 3) inertia.
    """
    moved = spread @ j.T  # moved[a, b] = mean of w_a (j w)_b
    return np.stack(
        [moved[:, 1, 2] - moved[:, 2, 1], moved[:, 2, 0] - moved[:, 0, 2], moved[:, 0, 1] - moved[:, 1, 0]], axis=1
    )

