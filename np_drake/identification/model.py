"""Grey-box model in dimensionless form: the residual that parameters leave of a flight."""

import dataclasses as dc
from functools import cached_property, lru_cache

import numpy as np
import scipy

from np_drake import attitude
from np_drake.effects.base import Motion
from np_drake.effects.blade_flapping import BladeFlapping
from np_drake.effects.linear_drag import LinearDrag
from np_drake.effects.rotor_gyroscopic import RotorGyroscopic
from np_drake.effects.translational_lift import TranslationalLift
from np_drake.effects.uneven_lag import UnevenLag
from np_drake.effects.weak_rotor import WeakRotor
from np_drake.estimation.noise import white_noise
from np_drake.identification.signals import G, Signals, Substeps, interpolated, means
from np_drake.rigid_body import STATE_SIZE, Q, V, W
from np_drake.training_data.accelerations import most_likely
from np_drake.vehicle import Vehicle
from np_drake.vehicle.vehicle import ThrottleMap

Values = dict[str, float]  # parameters of the model by name
LARGEST_YAW_INERTIA = 0.995  # of Jzz over Jxx + Jyy, whose bound is 1 [1]


@dc.dataclass(frozen=True)
class Frame:
    """What is given of the vehicle: geometry and units of length.

    positions: (4, 3) rotors from Bo [m].
    directions: (4,) signs of their reaction torques.
    radius: of a rotor [m]. unit: of inputs in hover: rotor speed [rad/s], throttle [1] or thrust
        [N] of one rotor.
    volts: reference; None: not known [V]. throttle: throttle in hover [1].
    """

    positions: np.ndarray
    directions: np.ndarray
    radius: float
    unit: float
    volts: float | None = None
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

    @cached_property
    def vehicle(self) -> Vehicle:
        """Vehicle of unit mass that hovers at rotor speeds of 1; torque over thrust of a rotor is
        its radius.
        """
        return Vehicle(
            mass=1.0,
            gravity=G,
            rotor_positions=self.positions.tolist(),
            rotor_directions=self.directions.tolist(),
            thrust_coefficient=0.25 * G,
            torque_coefficient=0.25 * G * self.radius,
        )


def inertia(v: Values) -> np.ndarray:
    """Return the inertia (3, 3) over mass and squared arm [1]."""
    xx = v["jxx"]
    yy = v["jxx"] * v["jyy"]
    xy, xz, yz = (-0.5 * (xx + yy) * v[name] for name in ("jxy", "jxz", "jyz"))
    return np.array(
        [[xx, xy, xz], [xy, yy, yz], [xz, yz, min(v["jzz"], LARGEST_YAW_INERTIA) * (xx + yy)]]
    )


def rotor_gains(v: Values, frame: Frame) -> np.ndarray:
    """Return the thrust (4,) of the rotors over their mean, at one input [1]."""
    sizes = np.array([v["gain_roll"], v["gain_pitch"], v["gain_yaw"] + v["shift_yaw"]])
    return 1.0 + sizes @ frame.patterns


def gyroscopic(J: np.ndarray, spread: np.ndarray) -> np.ndarray:
    """Return the means (m, 3) of w x J w, of an inertia J (3, 3) and means (m, 3, 3) of w w'."""
    products = np.cross(np.eye(3)[:, None], J.T)  # of axis j with J times axis k, (3, 3, 3)
    return spread.reshape(-1, 9) @ products.reshape(9, 3)


def target_speed(throttle: np.ndarray, linear: float, idle: float = 0.0) -> np.ndarray:
    """Return rotor speed over that at full throttle, by the curve of `ThrottleMap` above idling
    [1].

    Args:
        throttle: (..., 4) of 0 to 1 [1].
        linear: share of the curve's linear part [1].
        idle: rotor speed at no throttle, over the full one [1].
    """
    idle = max(idle, 0.0)
    return idle + (1.0 - idle) * np.sqrt(ThrottleMap(1.0, linear).thrust(throttle))


def collective_thrust(command: np.ndarray | float, slope: float, bend: float) -> np.ndarray:
    """Return the thrust of a collective command over that at 1, of any curve about it [1].

    Args:
        command: of any shape, over the one at which the curve is told [1].
        slope: of thrust there, over thrust over command [1].
        bend: half of its change [1].
    """
    beyond = np.asarray(command) - 1.0
    return np.maximum(1.0 + slope * beyond + bend * beyond**2, 0.0)


FORCE = slice(0, 3)
TORQUE = slice(3, 6)
SPEED = slice(6, 10)
# Of a rotor to its command.
RESPONSE = ("lag", "lag_ratio", "curve", "idle", "sag", "full_speed", "slope", "bend")


class FlightModel:
    """Residual channels of one flight. What its parameters leave unchanged is kept."""

    def __init__(self, flight: Signals, frame: Frame):
        self.flight = flight
        self.frame = frame
        self.channels = 10 if flight.command is not None else 6
        self._relative = flight.input / frame.unit
        self._time = flight.instants - flight.t[0]
        grid = self._grid = Substeps.of(flight.t)
        self._fine = np.append(grid.t, grid.t[-1] + grid.step) - flight.t[0]  # (k,) [s]
        # Body rates at a time [rad/s].
        self._rates = scipy.interpolate.CubicSpline(self._time, flight.smooth[flight.edges])
        # The two last are kept, for finite differences move one parameter at a time.
        keep = lru_cache(maxsize=2)
        self._lever, self._rotors = keep(self._make_lever), keep(self._make_rotors)
        self._driven, self._telemetry = keep(self._make_driven), keep(self._make_telemetry)

    def residual(self, v: Values) -> np.ndarray:
        """Return the channels (m, 6 or 10), measured less predicted."""
        s = self.flight
        frame = self.frame
        rotors = self.rotors(v)
        tilt = np.array([v["tilt_x"], v["tilt_y"], v["tilt_z"]])
        twist = np.array([v["twist_x"], v["twist_y"], v["twist_z"]])
        # From the axes of accelerometer, gyro and logged attitude to the body's. Those of the
        # attitude may be the sensors' or markers'.
        turns = np.array([tilt, tilt + twist, [v["level_x"], v["level_y"], v["heading"]]])
        turn, gyro, level = attitude.rotation_matrix(attitude.from_rotation_vector(turns))
        x = np.zeros((len(s), STATE_SIZE))  # in body axes
        x[:, Q.start] = 1.0
        x[:, W] = s.rate @ gyro.T
        if s.velocity is not None:
            x[:, V] = s.velocity @ level.T
        push, torque = np.split(self.wrench(v, self.motion(x, rotors), rotors), 2, axis=1)
        j = inertia(v) * frame.arm**2
        # w x J w of rates in the gyro's axes is that of the inertia in these axes.
        torque -= gyroscopic(gyro.T @ j @ gyro, s.spread) @ gyro.T
        e = np.zeros((len(s), self.channels))
        if s.drive != "collective":  # which tells no torque
            e[:, TORQUE] = s.alpha @ gyro.T - torque @ np.linalg.inv(j).T
        place = frame.arm * np.array([v["imu_x"], v["imu_y"], v["imu_z"]]) - self.center(v)
        push += self._lever(v["force_late"], v["window"]) @ (gyro.T @ place) @ gyro.T
        push[:, 2] += (rotors.late - rotors.thrust) @ self.gains(v)
        e[:, FORCE] = s.force - push @ turn - np.array([v["bias_x"], v["bias_y"], v["bias_z"]])
        if self.channels == 10:
            # Telemetry runs ahead of the body's sensors by the clock.
            e[:, SPEED] = self._measured_speed - self._telemetry(
                v["delay"] - v["clock"], _response(v)
            )
        return e

    def smooth(self, v: Values) -> None:
        """Take for the angular acceleration that moves the accelerometer what model and gyro tell
        together.

        It is that of the model and, of the gyro's difference to it, what stands above white noise.
        Measured rotor speed is not better than the gyro, which is then taken alone.
        """
        s = self.flight
        if s.drive in ("rotor_speed", "collective"):
            return
        length = np.diff(self._time)[:, None]
        missed = np.where(s.good[:, None], self.residual(v)[:, TORQUE], 0.0) * length
        difference = np.concatenate([np.zeros((1, 3)), np.cumsum(missed, axis=0)])
        likely = most_likely(difference, white_noise([difference]), s.step)
        rates = np.concatenate([np.zeros((1, 3)), np.cumsum(s.alpha * length, axis=0)])
        self._rates = scipy.interpolate.CubicSpline(self._time, rates - difference + likely)
        self._lever.cache_clear()

    def gains(self, v: Values) -> np.ndarray:
        """Return thrust over mass (4,) of the rotors at the unit of input [m/s²]."""
        out = np.full(4, 0.25 * G * v["scale"] * v["charge"])
        for rotor, gain in enumerate(rotor_gains(v, self.frame), 1):
            out *= WeakRotor(rotor, gain).thrust_gain(0.0)
        return out

    def center(self, v: Values) -> np.ndarray:
        """Return the centre of mass (3,) from Bo [m]."""
        return self.frame.arm * np.array(
            [v["com_x"] + v["shift_x"], v["com_y"] + v["shift_y"], v["com_z"]]
        )

    def motion(self, x: np.ndarray, rotors: "Rotors") -> Motion:
        """Return the motion of states x (m, 13), as effects on `Frame.vehicle` read it."""
        thrust = self.frame.vehicle.thrust_coefficient * rotors.speed**2
        return Motion(0.0, x, thrust, rotor_rate=rotors.rate)

    def wrench(self, v: Values, motion: Motion, rotors: "Rotors") -> np.ndarray:
        """Return force and torque about the centre of mass (m, 6) of rotors and air, in body axes
        and over mass [m/s², m²/s²].
        """
        frame = self.frame
        vehicle = frame.vehicle
        effects = (
            LinearDrag(v["drag"], v["drag"], v["climb"]),
            TranslationalLift(v["lift"]),
            RotorGyroscopic(v["rotor_momentum"] * inertia(v)[2, 2] * frame.arm**2),
        )
        out = np.sum([effect.body_wrench(vehicle, motion) for effect in effects], axis=0)
        # The air may turn a vehicle about x otherwise than about y.
        flapping = BladeFlapping(-frame.arm).body_wrench(vehicle, motion)
        out += flapping * [0.0, 0.0, 0.0, v["flap_y"], v["flap_x"], 0.0]
        mixer = self.gains(v) * vehicle.mixer
        # A motor that leans turns the vehicle about z, too.
        lean = v["lean_x"] * frame.patterns[0] + v["lean_y"] * frame.patterns[1]
        mixer[3] *= v["torque"] * (1.0 + frame.directions * lean)
        out[:, 2:] += rotors.thrust @ mixer.T
        out[:, 3:] -= out[:, :3] @ attitude.skew(self.center(v)).T
        return out

    def _window(self, late: float, share: float) -> tuple[np.ndarray, np.ndarray]:
        """Return begin and end (m,) of the times over which the accelerometer's readings are means
        [s].
        """
        # Whether an accelerometer of one reading a bin averages over it is not known.
        share = float(np.clip(share, 0.1, 1.0)) if self.flight.single else 1.0
        middle = 0.5 * (self._time[1:] + self._time[:-1]) - late
        half = 0.5 * share * np.diff(self._time)
        return middle - half, middle + half

    def _make_lever(self, late: float, share: float) -> np.ndarray:
        """Return the map (m, 3, 3) from a place to its acceleration at the accelerometer's time
        [1/s²].
        """
        starts, stops = self._window(late, share)
        alpha = (self._rates(stops) - self._rates(starts)) / (stops - starts)[:, None]
        return attitude.skew(alpha) + self._centripetal

    @cached_property
    def _centripetal(self) -> np.ndarray:
        """(m, 3, 3) map from a place to w x (w x place), which is (w w' - |w|² 1) place [1/s²]."""
        spread = self.flight.spread
        return spread - np.trace(spread, axis1=1, axis2=2)[:, None, None] * np.eye(3)

    def rotors(self, v: Values) -> "Rotors":
        """Return what the rotors do in the bins."""
        measured = self.flight.drive == "rotor_speed"
        late, response = (v["clock"], ()) if measured else (v["delay"], _response(v))
        return self._rotors(late, v["force_late"], v["window"], response)

    def _make_rotors(
        self, late: float, force_late: float, window: float, response: tuple[float, ...]
    ) -> "Rotors":
        t, speed = self._driven(response) if response else self._measured
        edges = self._time - late
        square = speed * speed
        starts, stops = self._window(force_late, window)
        return Rotors(
            means(t, speed, edges[:-1], edges[1:]),
            means(t, square, edges[:-1], edges[1:]),
            means(t, square, starts - late, stops - late),
            np.diff(interpolated(edges, t, speed), axis=0) / np.diff(edges)[:, None],
        )

    def _make_driven(self, response: tuple[float, ...]) -> tuple[np.ndarray, np.ndarray]:
        """Return the fine grid (k,) [s] and the relative speeds (k, 4) there by the command,
        without dead time, for the values of `RESPONSE`.
        """
        s = self.flight
        frame = self.frame
        lag, ratio, curve, idle, sag, full, *form = response
        if s.drive == "command":
            wanted = np.sqrt(self._relative)
        elif s.drive == "collective":
            wanted = np.sqrt(collective_thrust(self._relative, *form))
        else:
            throttle = s.input if s.command is None else s.command
            hover = target_speed(np.array(frame.throttle), curve, idle)
            wanted = full * target_speed(throttle, curve, idle) / hover
        if s.voltage is not None:
            battery = ThrottleMap(1.0, voltage=frame.volts, voltage_exponent=sag)
            wanted = wanted * np.sqrt(battery.thrust(1.0, s.voltage[:, None]))
        grid = self._grid
        return self._fine, UnevenLag(lag, lag * ratio).follow(wanted, grid.row, grid.step)

    def _make_telemetry(self, late: float, response: tuple[float, ...]) -> np.ndarray:
        """Return the relative rotor speeds (m, 4) that the throttle gives."""
        edges = self._time - late
        return means(*self._driven(response), edges[:-1], edges[1:])

    @cached_property
    def _measured(self) -> tuple[np.ndarray, np.ndarray]:
        """Measured relative speeds (k, 4) on the fine grid (k,) [s]."""
        return self._fine, interpolated(
            self._fine, self.flight.t - self.flight.t[0], self._relative
        )

    @cached_property
    def _measured_speed(self) -> np.ndarray:
        return means(*self._measured, self._time[:-1], self._time[1:])


def _response(v: Values) -> tuple[float, ...]:
    return tuple(v[name] for name in RESPONSE)


@dc.dataclass(frozen=True)
class Rotors:
    """Relative speeds of the rotors in the bins, (m, 4).

    speed: mean [1].
    thrust: mean square [1].
    late: the same at the accelerometer's time [1].
    rate: of its change [1/s].
    """

    speed: np.ndarray
    thrust: np.ndarray
    late: np.ndarray
    rate: np.ndarray

    def at(self, rows: np.ndarray) -> "Rotors":
        """Return what they do in these bins."""
        return Rotors(self.speed[rows], self.thrust[rows], self.late[rows], self.rate[rows])
