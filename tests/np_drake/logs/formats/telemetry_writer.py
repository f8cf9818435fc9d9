"""Writes a flight as a MAVLink telemetry log, with pymavlink."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from np_drake.flight_log import FlightLog
from tests.np_drake.logs.importing.autopilot_streams import frd, ned, q_ned_frd

SINCE = 1_700_000_000.0  # time of receipt at boot [s]
LATE = 0.02  # of what is received [s]
PX4, ARDUPILOT = 12, 3


def frames(
    log: FlightLog,
    pulses: np.ndarray,
    *,
    parameters: Mapping[str, float] | None = None,
    autopilot: int = PX4,
    kind: int = 2,
    boot: float = SINCE,
    port: int = 0,
    warning: tuple[float, str] = (0.0, ""),
    clips: int = 0,
) -> list[tuple[float, bytes]]:
    """Return times of receipt [s] and messages of a vehicle that boots at a time, and of a station
    beside it.

    Args:
        pulses: (n, k) of the outputs from 1 on [us].
        kind: of the vehicle, MAV_TYPE.
        warning: of the vehicle, at a time since boot [s].
        clips: samples of its accelerometer that clip between two rows.
    """
    from pymavlink.dialects.v20 import ardupilotmega as mavlink

    vehicle = mavlink.MAVLink(None, srcSystem=7, srcComponent=1)
    station = mavlink.MAVLink(None, srcSystem=255, srcComponent=190)
    out = [(0.0, vehicle.heartbeat_encode(kind, autopilot, 0, 0, 4).pack(vehicle))]
    for name, value in (parameters or {}).items():
        told = vehicle.param_value_encode(name.encode(), value, 9, 1, 0)
        out.append((0.0, told.pack(vehicle)))
    text = vehicle.statustext_encode(4, warning[1].encode())
    out += [(warning[0], text.pack(vehicle))] if warning[1] else []
    q, p, v, w = q_ned_frd(log.q), ned(log.p), ned(log.v), frd(log.w)
    for i, t in enumerate(log.t.tolist()):
        ms = round(1e3 * t)
        servos = [*np.round(pulses[i]).astype(int).tolist(), *[0] * 16][:16]
        messages = (
            vehicle.local_position_ned_encode(ms, *p[i], *v[i]),
            vehicle.attitude_quaternion_encode(ms, *q[i], *w[i]),
            vehicle.servo_output_raw_encode(1000 * ms, port, *servos),
            vehicle.vibration_encode(1000 * ms, 1.0, 1.0, 40.0, clips * i, 0, 0),
            vehicle.sys_status_encode(0, 0, 0, 0, 16200, 0, 0, 0, 0, 0, 0, 0, 0),
        )
        out += [(t, message.pack(vehicle)) for message in messages]
        out.append((t, station.heartbeat_encode(6, 8, 0, 0, 4).pack(station)))
    return [(boot + t + LATE, message) for t, message in sorted(out, key=lambda row: row[0])]


def write(path: Path, rows: Sequence[tuple[float, bytes]]) -> None:
    """Write messages with their times of receipt."""
    content = (round(1e6 * stamp).to_bytes(8, "big") + message for stamp, message in rows)
    path.write_bytes(b"".join(content))
