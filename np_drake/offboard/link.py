"""Link to an autopilot: datagrams, serial port, or two ends in memory."""

import contextlib
import socket
from collections.abc import Callable
from pathlib import Path
from typing import Any, Protocol

from np_drake.offboard.codec import NEEDS

SILENT = 5.0  # after which an address of a peer is forgotten [s]; source: own choice
MOST_READS = 1000  # of a socket in one go; source: own choice


class Link(Protocol):
    """Bytes to and from the other end; nothing of it waits."""

    def send(self, data: bytes) -> None:
        """Send bytes; what cannot be sent is lost."""

    def receive(self) -> list[bytes]:
        """Return what has come since the last call."""

    def close(self) -> None:
        """End the link."""


class MavlinkLink(Link):
    """Link by pymavlink.

    Args:
        address: udp:HOST:PORT or udpin:HOST:PORT listens, udpout:HOST:PORT calls, tcp:HOST:PORT, or
            a serial device.
        baud: of a serial device [1/s].
    Raises: ValueError: one line, where it cannot be opened.
    """

    def __init__(self, address: str, baud: int = 921600):
        try:
            from pymavlink import mavutil
        except ImportError as error:
            raise ValueError(NEEDS) from error
        _require_address(address)
        address = (
            f"udpin:{address[4:]}" if address.startswith("udp:") else address
        )  # by which silent peers are dropped
        try:
            self._port = mavutil.mavlink_connection(
                address, baud=baud, input=True, udp_timeout=SILENT, retries=1
            )
        except Exception as error:  # of sockets, serial ports and its own parser of addresses
            raise ValueError(f"--link: {address} cannot be opened: {error}.") from error
        self._has_datagrams = address.startswith("udp")
        serial: Any = self._port.port
        if hasattr(serial, "write_timeout"):
            serial.write_timeout = 0  # a line that does not take bytes loses them

    def send(self, data: bytes) -> None:
        """Send bytes; what cannot be sent is lost."""
        with contextlib.suppress(OSError):
            self._port.write(data)

    def receive(self) -> list[bytes]:
        """Return what has come since the last call."""
        found: list[bytes] = []
        with contextlib.suppress(OSError):
            for _ in range(MOST_READS):
                data = self._port.recv(4096)
                if data:
                    found.append(bytes(data))
                elif not (
                    self._has_datagrams and isinstance(data, bytes)
                ):  # an empty datagram is bytes
                    break
        return found

    def close(self) -> None:
        """End the link."""
        self._port.close()


def _require_address(address: str) -> None:
    """Check that an address can be one, and that a port that listens is free; pymavlink would share
    it.

    Raises: ValueError: where it is not.
    """
    kind, _, rest = address.partition(":")
    host, _, port = rest.rpartition(":")
    if kind not in ("udp", "udpin", "udpout", "tcp"):
        if not Path(address).is_char_device():
            raise ValueError(
                f"--link: must be as udp:127.0.0.1:14540, or a serial device; got {address!r}."
            )
        return
    if not host or not port.isdecimal() or not 1 <= int(port) <= 65535:
        raise ValueError(f"--link: must be as udp:127.0.0.1:14540; got {address!r}.")
    if kind in ("udp", "udpin"):
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
            try:
                probe.bind((host, int(port)))
            except OSError as error:
                raise ValueError(
                    f"--link: {address} cannot be opened: {error}. Another process may listen."
                ) from error


class Channel(Link):
    """End of a link in memory, for simulation in its own time.

    Args:
        clock: time [s].
        passes: returns when a message that is sent at a time arrives, infinite for never [s].
    """

    def __init__(self, clock: Callable[[], float], passes: Callable[[float], float]):
        self._clock, self._passes = clock, passes
        self._under_way: list[tuple[float, bytes]] = []
        self.other: Channel = self

    @classmethod
    def pair(
        cls, clock: Callable[[], float], passes: Callable[[float], float]
    ) -> "tuple[Channel, Channel]":
        """Return both ends.

        Args:
            clock: time [s].
            passes: returns when a message that is sent at a time arrives, infinite for never [s].
        """
        one, other = cls(clock, passes), cls(clock, passes)
        one.other, other.other = other, one
        return one, other

    def send(self, data: bytes) -> None:
        """Send bytes to the other end."""
        arrives = self._passes(self._clock())
        if arrives < float("inf"):
            self.other._under_way.append((arrives, data))

    def receive(self) -> list[bytes]:
        """Return what has come since the last call, in the order of arrival."""
        now = self._clock()
        come = sorted((m for m in self._under_way if m[0] <= now), key=lambda m: m[0])
        self._under_way = [m for m in self._under_way if m[0] > now]
        return [data for _, data in come]

    def close(self) -> None:
        """Forget what is under way."""
        self._under_way.clear()
