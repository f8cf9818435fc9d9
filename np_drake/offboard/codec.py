"""MAVLink messages as bytes, by pymavlink, and what they say in our units and axes."""

import dataclasses as dc
from typing import Any

import numpy as np

from np_drake import attitude
from np_drake.offboard.frames import turned_attitude, turned_body, turned_world
from np_drake.rigid_body import P, Q, V, W

NEEDS = "offboard control needs pymavlink; pip install 'np_drake[node]'."
COMPANION, AUTOPILOT, SYSTEM = (
    191,
    1,
    1,
)  # MAV_COMP_ID_ONBOARD_COMPUTER, MAV_COMP_ID_AUTOPILOT1; usual system
LOCAL_NED, BODY_FRD = 1, 12  # MAV_FRAME
IGNORE_ATTITUDE = 128  # ATTITUDE_TARGET_TYPEMASK: follow body rates and thrust
PX4, ARDUPILOT, NO_AUTOPILOT = 12, 3, 8  # MAV_AUTOPILOT
QUADROTOR, ONBOARD, ACTIVE = 2, 18, 4  # MAV_TYPE, MAV_STATE
ARMED, HIL, GUIDED, CUSTOM_MODE = 128, 32, 8, 1  # MAV_MODE_FLAG; HIL: simulated, motors are blocked
PX4_OFFBOARD, PX4_HOLD = (
    6 << 16,
    (4 << 16) | (3 << 24),
)  # custom_mode of PX4: main mode, and sub mode
COPTER_LOITER = 5
COPTER_GUIDED = (4, 20)  # custom_mode of ArduCopter: GUIDED, GUIDED_NOGPS


def require_pymavlink() -> Any:
    """Return pymavlink's messages.

    Raises: ValueError: where it is not installed.
    """
    try:
        from pymavlink.dialects.v20 import common
    except ImportError as error:
        raise ValueError(NEEDS) from error
    return common


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


@dc.dataclass(frozen=True)
class Command:
    """Body rates and thrust: those that a companion sends, or those in force as the autopilot
    tells.
    """

    stamp: float  # by the sender's clock [s]
    rates: np.ndarray  # (3,) in B [rad/s]
    thrust: float  # over that at full throttle [1]


@dc.dataclass(frozen=True)
class Battery:
    """Voltage of the battery."""

    voltage: float  # [V]


@dc.dataclass(frozen=True)
class HoldPlace:
    """Request of a companion that the autopilot hold its place."""


Said = Heartbeat | Pose | Inertial | Command | Battery | HoldPlace


class Codec:
    """One end of a link: packs what it sends, parses what it gets.

    A companion listens to the autopilot alone, component 1 of one system, and speaks to it; an
    autopilot listens to companions.

    Args:
        system: MAV_SYS_ID of the vehicle; 0: whose autopilot's heartbeat is heard first.
    Raises: ValueError: where pymavlink is not installed.
    """

    def __init__(self, component: int, system: int = 0):
        self._mavlink = require_pymavlink()
        self._out = self._mavlink.MAVLink(None, srcSystem=system or SYSTEM, srcComponent=component)
        self._in = self._mavlink.MAVLink(None)
        self._in.robust_parsing = True
        self._peer = AUTOPILOT if component == COMPANION else COMPANION
        self._system = system or (
            0 if component == COMPANION else SYSTEM
        )  # that is listened to; 0: not known

    def parse(self, data: bytes) -> list[Said]:
        """Return what complete messages say; unknown ones, and bytes that are none, are left
        out.
        """
        found = [
            self._said(message)
            for message in self._in.parse_buffer(data) or []
            if self._is_peer(message)
        ]
        return [said for said in found if said is not None]

    def _is_peer(self, message: Any) -> bool:
        if message.get_type() == "BAD_DATA" or message.get_srcComponent() != self._peer:
            return False
        if (
            not self._system
            and message.get_type() == "HEARTBEAT"
            and message.autopilot != NO_AUTOPILOT
        ):
            self._system = self._out.srcSystem = message.get_srcSystem()
        return self._system == message.get_srcSystem()

    def heartbeat(self, *, engaged: bool = False, autopilot: int = NO_AUTOPILOT) -> bytes:
        """Return a heartbeat of a companion, or of an autopilot of PX4's kind whose vehicle is
        simulated.

        Args:
            engaged: whether it is in offboard, and not in hold.
            autopilot: MAV_AUTOPILOT; `NO_AUTOPILOT` for a companion.
        """
        if autopilot == NO_AUTOPILOT:
            return self._pack(self._out.heartbeat_encode(ONBOARD, autopilot, 0, 0, ACTIVE))
        modes = (ARMED | HIL | CUSTOM_MODE, PX4_OFFBOARD if engaged else PX4_HOLD)
        return self._pack(self._out.heartbeat_encode(QUADROTOR, autopilot, *modes, ACTIVE))

    def odometry(self, stamp: float, x: np.ndarray) -> bytes:
        """Return the state as ODOMETRY, velocity in body axes.

        Args:
            stamp: [s].
            x: (13,) in W and B.
        """
        q, v = x[Q], attitude.rotate_back(x[Q], x[V])
        unknown = [float("nan")] * 21
        return self._pack(
            self._out.odometry_encode(
                round(1e6 * stamp),
                LOCAL_NED,
                BODY_FRD,
                *turned_world(x[P]),
                turned_attitude(q).tolist(),
                *turned_body(v),
                *turned_body(x[W]),
                unknown,
                unknown,
            )
        )

    def local_position(self, stamp: float, x: np.ndarray) -> bytes:
        """Return the state as LOCAL_POSITION_NED and ATTITUDE_QUATERNION.

        Args:
            stamp: [s].
            x: (13,) in W and B.
        """
        ms = round(1e3 * stamp)
        where = self._out.local_position_ned_encode(ms, *turned_world(x[P]), *turned_world(x[V]))
        turned = self._out.attitude_quaternion_encode(
            ms, *turned_attitude(x[Q]), *turned_body(x[W])
        )
        return self._pack(where) + self._pack(turned)

    def inertial(self, stamp: float, f: np.ndarray, w: np.ndarray) -> bytes:
        """Return a reading of the inertial sensor as HIGHRES_IMU.

        Args:
            stamp: [s].
            f: (3,) specific force in B [m/s²].
            w: (3,) body rates [rad/s].
        """
        rest = [0.0] * 7
        return self._pack(
            self._out.highres_imu_encode(
                round(1e6 * stamp), *turned_body(f), *turned_body(w), *rest, 0b111111
            )
        )

    def command(
        self, stamp: float, rates: np.ndarray, thrust: float, *, in_force: bool = False
    ) -> bytes:
        """Return body rates (3,) in B and thrust as SET_ATTITUDE_TARGET, or those in force as
        ATTITUDE_TARGET.

        Args:
            stamp: [s].
            rates: [rad/s].
            thrust: over that at full throttle [1].
        Raises: ValueError: where one is not finite: it is never sent.
        """
        values = np.array([*turned_body(np.asarray(rates)), thrust])
        if not np.isfinite(values).all():
            raise ValueError(
                f"offboard: body rates and thrust must be finite; got {values.tolist()}."
            )
        ms, level = round(1e3 * stamp) % 2**32, [1.0, 0.0, 0.0, 0.0]
        if in_force:
            return self._pack(self._out.attitude_target_encode(ms, IGNORE_ATTITUDE, level, *values))
        to = (self._target, AUTOPILOT, IGNORE_ATTITUDE)
        return self._pack(self._out.set_attitude_target_encode(ms, *to, level, *values))

    def request(self, message: str, rate: float) -> bytes:
        """Return the request that the autopilot send a message.

        Args:
            rate: [Hz].
        """
        identifier = getattr(self._mavlink, f"MAVLINK_MSG_ID_{message}")
        set_interval = self._mavlink.MAV_CMD_SET_MESSAGE_INTERVAL
        values = (float(identifier), 1e6 / rate, 0.0, 0.0, 0.0, 0.0, 0.0)
        return self._pack(
            self._out.command_long_encode(self._target, AUTOPILOT, set_interval, 0, *values)
        )

    def hold(self, autopilot: int) -> bytes:
        """Return the request that an autopilot, of a kind of MAV_AUTOPILOT, hold its place."""
        mode = (
            (COPTER_LOITER, 0)
            if autopilot == ARDUPILOT
            else (PX4_HOLD >> 16 & 0xFF, PX4_HOLD >> 24)
        )
        set_mode = self._mavlink.MAV_CMD_DO_SET_MODE
        values = (float(CUSTOM_MODE), *map(float, mode), 0.0, 0.0, 0.0, 0.0)
        return self._pack(
            self._out.command_long_encode(self._target, AUTOPILOT, set_mode, 0, *values)
        )

    @property
    def _target(self) -> int:
        return self._system or SYSTEM

    def _pack(self, message: Any) -> bytes:
        self._out.seq = (self._out.seq + 1) % 256
        return bytes(message.pack(self._out))

    def _said(self, m: Any) -> Said | None:
        kind, nan = m.get_type(), np.full(3, np.nan)
        if kind == "HEARTBEAT":
            return (
                None
                if m.autopilot == NO_AUTOPILOT
                else Heartbeat(_engaged(m), m.autopilot, bool(m.base_mode & HIL))
            )
        if (
            kind == "ODOMETRY"
            and m.frame_id == LOCAL_NED
            and m.child_frame_id in (BODY_FRD, LOCAL_NED)
        ):
            q = turned_attitude(np.array(m.q))
            v = np.array([m.vx, m.vy, m.vz])
            v = (
                attitude.rotate(q, turned_body(v))
                if m.child_frame_id == BODY_FRD
                else turned_world(v)
            )
            w = turned_body(np.array([m.rollspeed, m.pitchspeed, m.yawspeed]))
            return Pose(
                1e-6 * m.time_usec,
                kind,
                np.concatenate([turned_world(np.array([m.x, m.y, m.z])), q, v, w]),
            )
        if kind == "LOCAL_POSITION_NED":
            p, v = (
                turned_world(np.array([m.x, m.y, m.z])),
                turned_world(np.array([m.vx, m.vy, m.vz])),
            )
            return Pose(1e-3 * m.time_boot_ms, kind, np.concatenate([p, [*nan, np.nan], v, nan]))
        if kind == "ATTITUDE_QUATERNION":
            q = turned_attitude(np.array([m.q1, m.q2, m.q3, m.q4]))
            w = turned_body(np.array([m.rollspeed, m.pitchspeed, m.yawspeed]))
            return Pose(1e-3 * m.time_boot_ms, kind, np.concatenate([nan, q, nan, w]))
        if kind == "HIGHRES_IMU":
            f, w = np.array([m.xacc, m.yacc, m.zacc]), np.array([m.xgyro, m.ygyro, m.zgyro])
            return Inertial(1e-6 * m.time_usec, turned_body(f), turned_body(w))
        if kind == "COMMAND_LONG" and m.command == self._mavlink.MAV_CMD_DO_SET_MODE:
            return HoldPlace()
        if kind == "SYS_STATUS" and 0 < m.voltage_battery < 65535:  # which is for unknown
            return Battery(1e-3 * m.voltage_battery)
        if kind == ("ATTITUDE_TARGET" if self._peer == AUTOPILOT else "SET_ATTITUDE_TARGET"):
            rates = turned_body(np.array([m.body_roll_rate, m.body_pitch_rate, m.body_yaw_rate]))
            return Command(1e-3 * m.time_boot_ms, rates, float(m.thrust))
        return None


def _engaged(heartbeat: Any) -> bool:
    """Return whether the autopilot is armed, and in the mode in which it follows a companion."""
    mode = heartbeat.custom_mode
    if heartbeat.autopilot == PX4:
        follows = mode & 0xFF0000 == PX4_OFFBOARD
    elif heartbeat.autopilot == ARDUPILOT:
        follows = mode in COPTER_GUIDED
    else:
        follows = bool(heartbeat.base_mode & GUIDED)
    return follows and bool(heartbeat.base_mode & ARMED)
