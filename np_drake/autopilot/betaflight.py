"""Betaflight flown by body rates and collective thrust: settings, sticks, arming, motor outputs."""

import contextlib
import dataclasses as dc
from collections.abc import Sequence

import numpy as np

from np_drake.autopilot.command_line import CommandLine
from np_drake.autopilot.firmware import AutopilotError, Firmware, Sensed
from np_drake.vehicle import Vehicle
from np_drake.vehicle.rotor_layout import FIRMWARE
from np_drake.vehicle.scaling import usual_rate_loop
from np_drake.vehicle.vehicle import ThrottleMap

PERIOD = 0.001  # between states of the vehicle that the firmware gets [s]
LEAST_THROTTLE, MOST, MIDDLE, HALF = 1010, 2000, 1500, 500  # pulse widths of the receiver [µs]
RATE_STEP = 10.0  # of the firmware's largest rates [deg/s]
RESERVED = (  # settings by which the sticks are rates and thrust
    *(
        "min_check",
        "rates_type",
        "deadband",
        "yaw_deadband",
        "blackbox_device",
        "yaw_motors_reversed",
    ),
    *(
        f"{axis}_{name}"
        for axis in ("roll", "pitch", "yaw")
        for name in ("rc_rate", "srate", "expo")
    ),
)
STICK_EVERY = 5  # periods, while it is held [1]
WARM_UP, SETTLED = 6.0, 0.5  # calibration of the gyro, and what it takes to arm [s]
FASTEST = 200.0  # bandwidth beyond which no rotor follows [rad/s]; source: own choice
INTEGRAL, DAMPED = (
    20.0,
    0.5,
)  # bandwidth over that of I; share of the rotors' lag that D makes up for [1]; own choice
ROTOR_LAG = 0.03  # of a vehicle whose file names none [s]; source: own choice, as the simulator's
# Units of the firmware's gains: outputs per thousand over deg/s, deg and deg/s². Source: its pid.h.
P_UNIT, I_UNIT, D_UNIT, OUTPUT, MOST_GAIN = 0.032029, 0.244381, 0.000529, 1000.0, 250
_LOW = np.array(
    [MIDDLE, MIDDLE, 1000.0, MIDDLE, 1000.0]
)  # roll, pitch, throttle, yaw, arming: disarmed [µs]
_ARMED = np.array([0.0, 0.0, 0.0, 0.0, 1000.0])  # more [µs]


@dc.dataclass
class BetaflightConfig:
    """What a user sets of the firmware; everything else is as it is delivered."""

    # Of roll, pitch and yaw, for which the gains are computed from the vehicle; empty: gains as
    # delivered [rad/s].
    bandwidth: list[float] = dc.field(default_factory=lambda: [20.0, 20.0, 5.0])
    lines: list[str] = dc.field(
        default_factory=list
    )  # of its command line, after those that are needed here
    stick_rate: float = 150.0  # at which the receiver gets its channels [Hz]

    def check(self) -> "BetaflightConfig":
        """Return self after checking all values.

        Raises: ValueError: where one is impossible.
        """
        if not 10 <= self.stick_rate <= 1 / PERIOD:
            raise ValueError(
                f"betaflight: stick_rate must be 10 to {1 / PERIOD:g} Hz; got {self.stick_rate}."
            )
        for line in self.lines:
            words = line.split("=")[0].split()
            if (
                not words
                or words[-1] in RESERVED
                or words[0] in ("save", "exit", "defaults", "mixer", "aux", "batch")
            ):
                raise ValueError(
                    f"betaflight: lines must not hold {line!r}, which is set here; leave it out."
                )
        if len(self.bandwidth) not in (0, 3) or not all(0 < w < FASTEST for w in self.bandwidth):
            raise ValueError(
                f"betaflight: bandwidth must be three values up to {FASTEST:g} rad/s, or "
                f"none; got {self.bandwidth}."
            )
        return self


def thrust_map(vehicle: Vehicle) -> ThrottleMap:
    """Return the thrust of a rotor over its motor output: that of the vehicle file, quadratic where
    it names none.
    """
    return vehicle.throttle or ThrottleMap(full_thrust=vehicle.max_rotor_thrust)


def gain_lines(vehicle: Vehicle, bandwidth: Sequence[float]) -> list[str]:
    """Return the settings of a rate controller whose loop has a bandwidth on each axis.

    The loop is P over the vehicle's angular acceleration per motor output at hover; I is slower by
    `INTEGRAL`, D makes up for the lag of the rotors in roll and pitch. Feed-forward, which assumes
    a stick that a hand moves, is off.

    Args:
        bandwidth: of roll, pitch and yaw [rad/s].
    Raises: ValueError: where a gain is larger than the firmware takes.
    """
    curve, hover = thrust_map(vehicle), vehicle.mass * vehicle.gravity / 4
    output = float(curve.throttle(hover))
    slope = (
        float(curve.thrust(output + 0.01) - curve.thrust(output - 0.01)) / 0.02
    )  # [N per output]
    reach = (
        np.abs(vehicle.mixer[1:]).sum(axis=1) * slope / np.diag(vehicle.J)
    )  # [rad/s² per output]
    lines = []
    for axis, wanted, each in zip(("roll", "pitch", "yaw"), bandwidth, reach, strict=True):
        gain = OUTPUT * wanted / each / np.degrees(1.0)  # thousandths of an output per deg/s
        damping = (
            0.0 if axis == "yaw" else gain * (vehicle.rotor_time_constant or ROTOR_LAG) * DAMPED
        )
        p, i, d = gain / P_UNIT, gain * wanted / INTEGRAL / I_UNIT, damping / D_UNIT
        for letter, value in (("p", p), ("i", i), ("d", d), ("d_max", d), ("f", 0.0)):
            if letter in ("d", "d_max") and axis == "yaw":
                continue
            if round(value) > MOST_GAIN:
                raise ValueError(
                    f"betaflight: bandwidth of {axis} must be lower for this vehicle; "
                    f"{wanted:g} rad/s needs a gain "
                    f"{letter} of {value:.0f}, and {MOST_GAIN} is the firmware's largest."
                )
            lines.append(f"set {letter}_{axis} = {round(value)}")
    return ["simplified_tuning disable", *lines]


class Betaflight:
    """Firmware that holds body rates at a collective thrust.

    Args:
        vehicle: with four rotors in an X, in any order; its `rate_loop` names the largest rates and
            its `throttle` the thrust over motor output.
    Raises: AutopilotError: where there is no firmware or it refuses a setting. ValueError: on
        another layout.
    """

    def __init__(self, vehicle: Vehicle, config: BetaflightConfig | None = None):
        self.config = (config or BetaflightConfig()).check()
        self._order, self._mirrored = _motors_of(vehicle)
        self._map = thrust_map(vehicle)
        most = np.degrees((vehicle.rate_loop or usual_rate_loop(vehicle)).max_rate)
        self._most = RATE_STEP * np.ceil(most / RATE_STEP)
        self._since, self._outputs = np.inf, np.zeros(4)
        self._last: tuple[Sensed, np.ndarray] | None = None  # what was seen and commanded last
        self._gains = gain_lines(vehicle, self.config.bandwidth) if self.config.bandwidth else []
        self.firmware = Firmware()
        try:
            self._idle = self._set_up()
        except AutopilotError:
            self.close()
            raise

    def arm(self, at_rest: Sensed, thrust: float) -> np.ndarray:
        """Arm the firmware at rest, and bring the motors to a collective thrust; return their
        outputs (4,) [1].

        Args:
            thrust: collective [N].
        Raises: AutopilotError: where it refuses to arm, with its reasons.
        """
        with CommandLine(self.firmware) as line:  # once it is there, the firmware has booted
            self._hold(at_rest, _LOW, WARM_UP)
            self._hold(at_rest, _LOW + _ARMED, SETTLED)
            if not self._outputs.any():
                reasons = ", ".join(line.refusals()) or "no reason is given"
                raise AutopilotError(f"betaflight: does not arm: {reasons}.")
        return self._hold(at_rest, self._channels(np.array([thrust, 0.0, 0.0, 0.0])), SETTLED)

    def step(self, seen: Sensed, command: np.ndarray) -> np.ndarray:
        """Return the motor outputs (4,) after one more period [1].

        Args:
            command: (4,) collective thrust and body rates [N, rad/s].
        Raises: AutopilotError: where the firmware has ended or hangs.
        """
        self._since += PERIOD
        self._last = seen, command
        if self._since >= 1 / self.config.stick_rate - 1e-9:
            self._since = 0.0
            self.firmware.stick(self._channels(command))
        return self._tick(seen)

    def rotor_thrust(self, motors: np.ndarray) -> np.ndarray:
        """Return the thrust (..., 4) of rotors at motor outputs (..., 4) [N]."""
        return self._map.thrust(motors)

    def blackbox(self) -> bytes:
        """Disarm, which ends the blackbox file of the flight, and return it; empty where there is
        none.

        Sticks and sensors stay as they are until then, so that the file holds nothing but flight.
        """
        if self._last is not None:
            seen, command = self._last
            self._hold(seen, self._channels(command) - _ARMED, SETTLED)
        files = sorted(self.firmware.folder.glob("LOG*.BF*"))
        return files[-1].read_bytes() if files else b""

    def close(self) -> None:
        """End the firmware."""
        self.firmware.close()

    def __enter__(self) -> "Betaflight":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _set_up(self) -> float:
        """Set the firmware up, and return the motor output at no throttle [1]."""
        rates = [
            f"set {axis}_{name} = {round(most / RATE_STEP)}"
            for axis, most in zip(("roll", "pitch", "yaw"), self._most, strict=True)
            for name in ("rc_rate", "srate")
        ]
        with CommandLine(self.firmware) as line:
            line.enter(
                [
                    "mixer QUADX",
                    "feature AIRMODE",
                    f"set min_check = {LEAST_THROTTLE}",
                    "set rates_type = ACTUAL",
                    *rates,
                    "set roll_expo = 0",
                    "set pitch_expo = 0",
                    "set yaw_expo = 0",
                    "set blackbox_device = VIRTUAL",
                    f"set yaw_motors_reversed = {'ON' if self._mirrored else 'OFF'}",
                    "aux 0 0 0 1700 2100 0 0",
                    *self._gains,
                    *self.config.lines,
                ]
            )
            idle = (
                float(line.ask("get motor_idle").partition("motor_idle = ")[2].split()[0]) / 10000
            )
            line.save()
        return idle

    def _channels(self, command: np.ndarray) -> np.ndarray:
        """Return the receiver's channels (5,) for collective thrust and body rates [N, rad/s]."""
        throttle = (self._map.throttle(command[0] / 4) - self._idle) / (1 - self._idle)
        roll, pitch, yaw = HALF * np.degrees(command[1:]) / self._most
        sticks = (roll, pitch, (MOST - LEAST_THROTTLE) * throttle, -yaw, HALF)
        return np.array([MIDDLE, MIDDLE, LEAST_THROTTLE, MIDDLE, MIDDLE]) + sticks

    def _hold(self, seen: Sensed, channels: np.ndarray, seconds: float) -> np.ndarray:
        for k in range(round(seconds / PERIOD)):
            if k % STICK_EVERY == 0:
                self.firmware.stick(channels)
            self._tick(seen)
        return self._outputs

    def _tick(self, seen: Sensed) -> np.ndarray:
        """Return the outputs (4,) of the vehicle's rotors after one period [1]."""
        self.firmware.sense(seen)
        self.firmware.advance(PERIOD)
        newest = self.firmware.motors()
        if newest is not None:
            self._outputs = newest[self._order]
        return self._outputs


def _motors_of(vehicle: Vehicle) -> tuple[list[int], bool]:
    """Return the firmware's motor of each rotor, from 0, and whether all turn the other way than by
    default.

    Raises: ValueError: where the vehicle is no X whose opposite rotors turn alike.
    """
    layout, positions, directions = (
        FIRMWARE["betaflight"],
        vehicle.rotor_positions,
        vehicle.rotor_directions,
    )
    try:
        return layout.order_of(positions, directions), False
    except ValueError as error:
        with contextlib.suppress(ValueError):
            return layout.order_of(positions, [-turn for turn in directions]), True
        raise ValueError(f"betaflight: vehicle {vehicle.name!r}: {error}") from error
