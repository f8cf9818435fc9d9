"""MAVLink by pymavlink: messages as bytes, what they say in our units and axes, and the link that
carries them.

MAVLink is in north, east, down and forward, right, down; we have W with z up and B with z along the
thrust. The turn between them, `NED_TO_ENU` and `FRD_TO_FLU`, is its own inverse.
"""

import contextlib
import dataclasses as dc
import re
import socket
from pathlib import Path
from typing import Any

import numpy as np

from np_drake import attitude
from np_drake.logs.importing.log_map import FRD_TO_FLU, NED_TO_ENU, Q_BODY, Q_WORLD
from np_drake.rigid_body import P, Q, V, W

NEEDS = "offboard control needs pymavlink; pip install 'np_drake[node]'."
# MAV_COMP_ID_ONBOARD_COMPUTER, MAV_COMP_ID_AUTOPILOT1; usual system
COMPANION = 191
AUTOPILOT = 1
SYSTEM = 1
# MAV_FRAME
LOCAL_NED = 1
BODY_FRD = 12
IGNORE_ATTITUDE = 128  # ATTITUDE_TARGET_TYPEMASK: follow body rates and thrust
# MAV_AUTOPILOT
PX4 = 12
ARDUPILOT = 3
NO_AUTOPILOT = 8
# MAV_TYPE, MAV_STATE
QUADROTOR = 2
ONBOARD = 18
ACTIVE = 4
# MAV_MODE_FLAG; HIL: simulated, motors are blocked
ARMED = 128
HIL = 32
GUIDED = 8
CUSTOM_MODE = 1
# custom_mode of PX4: main mode, and sub mode
PX4_OFFBOARD = 6 << 16
PX4_HOLD = (4 << 16) | (3 << 24)
# custom_mode of ArduCopter: GUIDED, GUIDED_NOGPS
COPTER_LOITER = 5
COPTER_GUIDED = (4, 20)
SILENT = 5.0  # after which an address of a peer is forgotten [s]; source: own choice
MOST_READS = 1000  # of a socket in one go; source: own choice


@dc.dataclass(frozen=True)
class Heartbeat:
    """What an autopilot says of itself."""

    engaged: bool  # armed, and follows what is sent
    autopilot: int  # MAV_AUTOPILOT
    simulated: bool = False  # its vehicle, whose clock may be slow


@dc.dataclass(frozen=True)
class Pose:
    """State, or the part of it that a message has; NaN elsewhere."""

    stamp: float  # by the sender's clock [s]
    kind: str  # of the message
    x: np.ndarray  # (13,) in W and B


@dc.dataclass(frozen=True)
class Inertial:
    """Reading of the inertial sensor."""

    stamp: float  # by the sender's clock [s]
    f: np.ndarray  # (3,) specific force in B [m/s²]
    w: np.ndarray  # (3,) body rates [rad/s]
    kind: str = "HIGHRES_IMU"  # of the message


@dc.dataclass(frozen=True)
class Command:
    """Body rates and thrust: those that a companion sends, or those in force as the autopilot
    tells.
    """

    rates: np.ndarray  # (3,) in B [rad/s]
    thrust: float  # over that at full throttle [1]
    stamp: float = 0.0  # by the sender's clock [s]
    kind: str = "ATTITUDE_TARGET"  # of the message

    @property
    def values(self) -> np.ndarray:
        """Thrust and rates (4,)."""
        return np.array([self.thrust, *self.rates])


@dc.dataclass(frozen=True)
class Battery:
    """Voltage of the battery."""

    voltage: float  # [V]


@dc.dataclass(frozen=True)
class HoldPlace:
    """Request of a companion that the autopilot hold its place."""


Message = Heartbeat | Pose | Inertial | Command | Battery | HoldPlace


class Codec:
    """One end of a link: packs what it sends, parses what it gets.

    A companion listens to the autopilot alone, component 1 of one system, and speaks to it; an
    autopilot, of PX4's kind with a simulated vehicle, listens to companions.

    Args:
        system: MAV_SYS_ID of the vehicle; 0: whose autopilot's heartbeat is heard first.
    Raises: ValueError: where pymavlink is not installed.
    """

    def __init__(self, component: int, system: int = 0):
        try:
            from pymavlink.dialects.v20 import common
        except ImportError as error:
            raise ValueError(NEEDS) from error
        self._mavlink: Any = common
        self._out = common.MAVLink(None, srcSystem=system or SYSTEM, srcComponent=component)
        self._in = common.MAVLink(None)
        self._in.robust_parsing = True
        self._is_companion = component == COMPANION
        # that is listened to; 0: not known
        self._system = system or (0 if self._is_companion else SYSTEM)

    def parse(self, data: bytes) -> list[Message]:
        """Return what complete messages say; unknown ones, and bytes that are none, are left
        out.
        """
        messages = self._in.parse_buffer(data) or []
        read = (self._read(message) for message in messages if self._is_peer(message))
        return [message for message in read if message is not None]

    def heartbeat(self, engaged: bool = False) -> bytes:
        """Return a heartbeat: a companion's, or an autopilot's, in offboard or in hold."""
        if self._is_companion:
            return self._pack(self._out.heartbeat_encode(ONBOARD, NO_AUTOPILOT, 0, 0, ACTIVE))
        flags = ARMED | HIL | CUSTOM_MODE
        mode = PX4_OFFBOARD if engaged else PX4_HOLD
        return self._pack(self._out.heartbeat_encode(QUADROTOR, PX4, flags, mode, ACTIVE))

    def odometry(self, stamp: float, x: np.ndarray) -> bytes:
        """Return the state (13,) at a time [s] as ODOMETRY, velocity in body axes."""
        unknown = [float("nan")] * 21
        return self._pack(
            self._out.odometry_encode(
                round(1e6 * stamp),
                LOCAL_NED,
                BODY_FRD,
                *NED_TO_ENU @ x[P],
                turned_attitude(x[Q]).tolist(),
                *FRD_TO_FLU * attitude.rotate_back(x[Q], x[V]),
                *FRD_TO_FLU * x[W],
                unknown,
                unknown,
            )
        )

    def inertial(self, stamp: float, f: np.ndarray, w: np.ndarray) -> bytes:
        """Return specific force (3,) and body rates (3,) in B at a time as HIGHRES_IMU
        [s, m/s², rad/s].
        """
        return self._pack(
            self._out.highres_imu_encode(
                round(1e6 * stamp), *FRD_TO_FLU * f, *FRD_TO_FLU * w, *([0.0] * 7), 0b111111
            )
        )

    def command(self, stamp: float, rates: np.ndarray, thrust: float) -> bytes:
        """Return body rates (3,) in B [rad/s] and thrust over that at full throttle [1]: a
        companion's SET_ATTITUDE_TARGET, or an autopilot's ATTITUDE_TARGET of those in force.

        Raises: ValueError: where one is not finite: it is never sent.
        """
        values = np.array([*FRD_TO_FLU * rates, thrust])
        if not np.isfinite(values).all():
            raise ValueError(
                f"offboard: body rates and thrust must be finite; got {values.tolist()}."
            )
        ms = round(1e3 * stamp) % 2**32
        level = [1.0, 0.0, 0.0, 0.0]
        if not self._is_companion:
            return self._pack(self._out.attitude_target_encode(ms, IGNORE_ATTITUDE, level, *values))
        to = (self._system or SYSTEM, AUTOPILOT, IGNORE_ATTITUDE)
        return self._pack(self._out.set_attitude_target_encode(ms, *to, level, *values))

    def request(self, message: str, rate: float) -> bytes:
        """Return the request that the autopilot send a message at a rate [Hz]."""
        return self._ask(
            self._mavlink.MAV_CMD_SET_MESSAGE_INTERVAL,
            getattr(self._mavlink, f"MAVLINK_MSG_ID_{message}"),
            1e6 / rate,
            0,
        )

    def hold(self, autopilot: int) -> bytes:
        """Return the request that an autopilot, of a kind of MAV_AUTOPILOT, hold its place."""
        main, sub = (COPTER_LOITER, 0) if autopilot == ARDUPILOT else (4, 3)  # as PX4_HOLD
        return self._ask(self._mavlink.MAV_CMD_DO_SET_MODE, CUSTOM_MODE, main, sub)

    def _ask(self, command: int, first: float, second: float, third: float) -> bytes:
        values = (float(first), float(second), float(third), 0.0, 0.0, 0.0, 0.0)
        return self._pack(
            self._out.command_long_encode(self._system or SYSTEM, AUTOPILOT, command, 0, *values)
        )

    def _pack(self, message: Any) -> bytes:
        self._out.seq = (self._out.seq + 1) % 256
        return bytes(message.pack(self._out))

    def _is_peer(self, m: Any) -> bool:
        """Return whether a message is for us; the first autopilot's heartbeat names the system."""
        kind = m.get_type()
        peer = AUTOPILOT if self._is_companion else COMPANION
        if kind == "BAD_DATA" or m.get_srcComponent() != peer:
            return False
        if not self._system and kind == "HEARTBEAT" and m.autopilot != NO_AUTOPILOT:
            self._system = self._out.srcSystem = m.get_srcSystem()
        return self._system == m.get_srcSystem()

    def _read(self, m: Any) -> Message | None:
        kind = m.get_type()
        nan = np.full(3, np.nan)
        if kind == "HEARTBEAT" and m.autopilot != NO_AUTOPILOT:
            return Heartbeat(_engaged(m), m.autopilot, bool(m.base_mode & HIL))
        axes = (BODY_FRD, LOCAL_NED)  # of a velocity
        if kind == "ODOMETRY" and m.frame_id == LOCAL_NED and m.child_frame_id in axes:
            q = turned_attitude(np.array(m.q))
            v = np.array([m.vx, m.vy, m.vz])
            in_body = m.child_frame_id == BODY_FRD
            v = attitude.rotate(q, FRD_TO_FLU * v) if in_body else NED_TO_ENU @ v
            parts = [NED_TO_ENU @ np.array([m.x, m.y, m.z]), q, v, _rates(m)]
            return Pose(1e-6 * m.time_usec, kind, np.concatenate(parts))
        if kind == "LOCAL_POSITION_NED":
            p, v = (NED_TO_ENU @ r for r in ([m.x, m.y, m.z], [m.vx, m.vy, m.vz]))
            return Pose(1e-3 * m.time_boot_ms, kind, np.concatenate([p, [*nan, np.nan], v, nan]))
        if kind == "ATTITUDE_QUATERNION":
            q = turned_attitude(np.array([m.q1, m.q2, m.q3, m.q4]))
            return Pose(1e-3 * m.time_boot_ms, kind, np.concatenate([nan, q, nan, _rates(m)]))
        if kind == "HIGHRES_IMU":
            f = np.array([m.xacc, m.yacc, m.zacc])
            w = np.array([m.xgyro, m.ygyro, m.zgyro])
            return Inertial(1e-6 * m.time_usec, FRD_TO_FLU * f, FRD_TO_FLU * w)
        if kind == "COMMAND_LONG" and m.command == self._mavlink.MAV_CMD_DO_SET_MODE:
            return HoldPlace()
        if kind == "SYS_STATUS" and 0 < m.voltage_battery < 65535:  # which is for unknown
            return Battery(1e-3 * m.voltage_battery)
        if kind == ("ATTITUDE_TARGET" if self._is_companion else "SET_ATTITUDE_TARGET"):
            rates = np.array([m.body_roll_rate, m.body_pitch_rate, m.body_yaw_rate])
            return Command(FRD_TO_FLU * rates, float(m.thrust), 1e-3 * m.time_boot_ms)
        return None


def turned_attitude(q: np.ndarray) -> np.ndarray:
    """Return an attitude (4,), w, x, y, z from the one body to its world, in the other's."""
    return attitude.multiply(attitude.multiply(Q_WORLD, q), Q_BODY)


def _rates(m: Any) -> np.ndarray:
    return FRD_TO_FLU * np.array([m.rollspeed, m.pitchspeed, m.yawspeed])


def _engaged(heartbeat: Any) -> bool:
    """Return whether the autopilot is armed, and in the mode in which it follows a companion."""
    mode = heartbeat.custom_mode
    flags = heartbeat.base_mode
    follows = {PX4: mode & 0xFF0000 == PX4_OFFBOARD, ARDUPILOT: mode in COPTER_GUIDED}
    return bool(flags & ARMED and follows.get(heartbeat.autopilot, flags & GUIDED))


class MavlinkLink:
    """Link by pymavlink: bytes to and from the other end; nothing of it waits.

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
        if address.startswith("udp:"):
            address = f"udpin:{address[4:]}"  # by which silent peers are dropped
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
        received: list[bytes] = []
        with contextlib.suppress(OSError):
            for _ in range(MOST_READS):
                data = self._port.recv(4096)
                if not data and not (self._has_datagrams and isinstance(data, bytes)):
                    break  # an empty datagram is bytes
                received.append(bytes(data))
        return received

    def close(self) -> None:
        """End the link."""
        self._port.close()


def _require_address(address: str) -> None:
    """Check that an address can be one, and that a port that listens is free; pymavlink would share
    it.
    """
    parts = re.fullmatch(r"(udp|udpin|udpout|tcp):(.+):(\d+)", address)
    if parts is None or not 1 <= int(parts[3]) <= 65535:
        if Path(address).is_char_device():
            return
        raise ValueError(
            f"--link: must be as udp:127.0.0.1:14540, or a serial device; got {address!r}."
        )
    if parts[1] in ("udp", "udpin"):
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
            try:
                probe.bind((parts[2], int(parts[3])))
            except OSError as error:
                raise ValueError(
                    f"--link: {address} cannot be opened: {error}. Another process may listen."
                ) from error
