"""A flight as the messages of PX4 and ArduPilot: NED and FRD, and motors as each of them numbers
its outputs.
"""

import numpy as np

from np_drake import attitude
from np_drake.flight_log import FlightLog
from np_drake.logs.formats.format import Stream
from np_drake.vehicle import Vehicle

# Our rotors, front left first and clockwise, in the order of PX4's and ArduPilot's X.
PX4_FROM_OURS = [1, 3, 0, 2]
PX4_CORNERS = {
    "CA_ROTOR_COUNT": 4,
    **{f"CA_ROTOR{n}_PX": x for n, x in enumerate((0.13, -0.13, 0.13, -0.13))},
    **{f"CA_ROTOR{n}_PY": y for n, y in enumerate((0.13, -0.13, -0.13, 0.13))},
    **{f"CA_ROTOR{n}_KM": k for n, k in enumerate((0.05, 0.05, -0.05, -0.05))},
}


def throttle(log: FlightLog) -> np.ndarray:
    """Return the throttle (n, 4) of our rotors, of which each gives 12 N at 1."""
    return np.sqrt(np.maximum(log.u @ Vehicle().unmixer.T, 0.0) / 12.0)


def named(names: list[str], values: np.ndarray) -> dict[str, np.ndarray]:
    return dict(zip(names, np.asarray(values, float).T, strict=True))


def ned(value: np.ndarray) -> np.ndarray:
    return value[:, [1, 0, 2]] * [1, 1, -1]


def frd(value: np.ndarray) -> np.ndarray:
    return value * [1, -1, -1]


def q_ned_frd(q: np.ndarray) -> np.ndarray:
    half = np.sqrt(0.5)
    world, body = np.array([0, half, half, 0]), np.array([0, 1.0, 0, 0])
    return attitude.multiply(
        attitude.multiply(np.tile(world, (len(q), 1)), q), np.tile(body, (len(q), 1))
    )


def _force(log: FlightLog) -> np.ndarray:
    return frd(attitude.rotate_back(log.q, log.a + [0.0, 0.0, 9.81]))


def px4(log: FlightLog, outputs: dict[str, np.ndarray], start: float = 1.0) -> dict[str, Stream]:
    """Return PX4's messages; `outputs`: columns by stream, as `actuator_motors`: (n, k)."""
    columns = {
        "vehicle_local_position": named(
            ["x", "y", "z", "vx", "vy", "vz"], np.column_stack([ned(log.p), ned(log.v)])
        ),
        "vehicle_attitude": named([f"q[{i}]" for i in range(4)], q_ned_frd(log.q)),
        "vehicle_angular_velocity": named([f"xyz[{i}]" for i in range(3)], frd(log.w)),
        "sensor_combined": named([f"accelerometer_m_s2[{i}]" for i in range(3)], _force(log)),
    }
    for name, values in outputs.items():
        kind = {"actuator_outputs": "output[{}]", "esc_status": "esc[{}].esc_rpm"}.get(
            name.split(".")[0], "control[{}]"
        )
        columns[name] = named([kind.format(i) for i in range(values.shape[1])], values)
    return {name: Stream(log.t + start, values) for name, values in columns.items()}


def ardupilot(log: FlightLog, outputs: np.ndarray, first: int = 1) -> dict[str, Stream]:
    """Return ArduPilot's messages; `outputs`: (n, k) pulses of the outputs from `first` on [us]."""
    columns = {
        "XKF1.0": named(
            ["PN", "PE", "PD", "VN", "VE", "VD"], np.column_stack([ned(log.p), ned(log.v)])
        ),
        "XKQ.0": named(["Q1", "Q2", "Q3", "Q4"], q_ned_frd(log.q)),
        "IMU.0": named(
            ["GyrX", "GyrY", "GyrZ", "AccX", "AccY", "AccZ"],
            np.column_stack([frd(log.w), _force(log)]),
        ),
        "RCOU": named([f"C{first + i}" for i in range(outputs.shape[1])], outputs),
    }
    return {name: Stream(log.t + 1.0, values) for name, values in columns.items()}
