"""Betaflight's own command line, by which it is set up, and the messages that tell why it does not
arm.
"""

import contextlib
import socket
import struct
from collections.abc import Callable, Sequence

from np_drake.autopilot.firmware import COMMAND_LINE, AutopilotError, Firmware

TICK = 0.005  # by which the firmware goes on while it is asked [s]
BOOT = 10.0  # of the firmware's time until its command line must answer [s]
CALL, CALLS = 1.0, 10  # after which it is called again [s], and how often [1]
STATUS = 150  # message MSP_STATUS_EX
# Reasons not to arm, in the order of the firmware's bits.
REASONS = (
    "no gyro",
    "failsafe",
    "no receiver",
    "not disarmed",
    "failsafe switch",
    "runaway",
    "crash",
    "throttle not low",
    "not level",
    "boot grace time",
    "no prearm",
    "system load",
    "calibrating",
    "command line open",
    "menu open",
    "blackbox transfer",
    "MSP",
    "paralysed",
    "GPS rescue",
    "rescue switch",
    "motor telemetry",
    "reboot required",
    "motor protocol",
    "crash flip",
    "altitude hold",
    "position hold",
    "arm switch",
)


class CommandLine:
    """One connection to the command line of a firmware.
    Raises: AutopilotError: where it does not answer.
    """

    def __init__(self, firmware: Firmware):
        self._firmware = firmware
        self._socket, self._asked = _connect(firmware), 0

    def enter(self, lines: Sequence[str]) -> None:
        """Give the firmware its settings.

        Args:
            lines: of the command line, as `set min_check = 1010`.
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
                reason = (
                    answer.partition("###ERROR")[2].strip(" :#\r\n").splitlines()[0].strip(" #")
                )
                raise AutopilotError(f"betaflight: refuses `{line}`: {reason}.")

    def save(self) -> None:
        """Save the settings, with which the firmware starts anew; ends the connection."""
        self._socket.sendall(b"save\n")
        with contextlib.suppress(AutopilotError, ConnectionError):  # it ends
            for _ in range(round(BOOT / TICK)):
                self._receive()
        self._socket.close()
        self._firmware.start()

    def ask(self, line: str) -> str:
        """Return what the firmware answers to one line; the command line stays open until the next
        start.

        Raises: AutopilotError: where it does not answer.
        """
        if not self._asked:
            self._open()
        self._asked += 1
        mark = (
            f"# asked {self._asked}"  # a comment, which is echoed once the line before it is done
        )
        self._socket.sendall(f"{line}\n{mark}\n".encode())
        answer = self._read(lambda text: mark in text and text.rstrip(" ").endswith("#"))
        if answer is None:
            raise AutopilotError(f"betaflight: no answer to `{line}`.")
        return answer.partition(mark)[0]

    def refusals(self) -> list[str]:
        """Return the reasons for which the firmware does not arm.

        Raises: AutopilotError: where it does not tell its status.
        """
        self._socket.sendall(b"$M<" + bytes([0, STATUS, STATUS]))
        answer, begin = b"", self._firmware.time
        while self._firmware.time - begin < BOOT:
            answer += self._receive()
            _, found, body = answer.partition(b"$M>")
            if found and body and len(body) >= body[0] + 3:
                (bits,) = struct.unpack_from("<I", body, 2 + 17 + (body[2 + 15] & 0x0F))
                return [reason for k, reason in enumerate(REASONS) if bits >> k & 1]
        raise AutopilotError("betaflight: the firmware does not tell its status.")

    def close(self) -> None:
        """End the connection."""
        self._socket.close()

    def __enter__(self) -> "CommandLine":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _open(self) -> None:
        """Open the command line; a firmware that still boots does not hear the first call."""
        for _ in range(CALLS):
            self._socket.sendall(b"#")
            if self._read(lambda text: "#" in text, seconds=CALL) is not None:
                return
        raise AutopilotError("betaflight: its command line does not open.")

    def _read(self, done: Callable[[str], bool], seconds: float = BOOT) -> str | None:
        """Return the answer once it is `done`; None where it is not after a time of the firmware
        [s].
        """
        answer, begin = b"", self._firmware.time
        while self._firmware.time - begin < seconds:
            answer += self._receive()
            if done(answer.decode(errors="replace")):
                return answer.decode(errors="replace")
        return None

    def _receive(self) -> bytes:
        self._firmware.advance(TICK)
        try:
            return self._socket.recv(65536)
        except TimeoutError:
            return b""


def _connect(firmware: Firmware) -> socket.socket:
    begin = firmware.time
    while firmware.time - begin < BOOT:
        try:
            connection = socket.create_connection(
                ("127.0.0.1", COMMAND_LINE + firmware.offset), 1.0
            )
        except OSError:
            firmware.advance(TICK)
            continue
        connection.settimeout(0.002)
        return connection
    raise AutopilotError(f"betaflight: no command line after {BOOT:g} s.")
