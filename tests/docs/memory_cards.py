"""Memory cards of the guide: simulated flights as PX4 and Crazyflie logs, in the conventions of
those formats.
"""

import runpy
from pathlib import Path
from typing import Any

import numpy as np

from np_drake import attitude
from np_drake.effects.linear_drag import LinearDrag
from np_drake.flight_log import FlightLog
from np_drake.logs.formats.format import Stream
from np_drake.vehicle import Vehicle, load_vehicle

TESTS = Path(__file__).parents[1]
HOVER = 0.41  # throttle
TO_NED = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
Q_NED = np.array([0.0, np.sqrt(0.5), np.sqrt(0.5), 0.0])
Q_FRD = np.array([0.0, 1.0, 0.0, 0.0])
FRD = np.array([1.0, -1.0, -1.0])
CRAZYFLIE = load_vehicle("crazyflie_brushless").with_mass(0.0397)


def script(name: str) -> dict[str, Any]:
    """Return what a module of tests/np_drake holds."""
    return runpy.run_path(str(TESTS / "np_drake" / name))


def flown(seed: int, vehicle: Vehicle, drag: float) -> FlightLog:
    """Return a flight under drag [N·s/m], with noise."""
    fly = script("diagnosis/simulated_flights.py")["fly"]
    effect = LinearDrag(drag, drag, drag)
    log: FlightLog = fly(effect, seed=seed, seconds=9.0, noise=1.0, vehicle=vehicle)
    return log


def columns(names: str, values: np.ndarray) -> dict[str, np.ndarray]:
    """Return columns (n,) by name."""
    return dict(zip(names.split(), np.reshape(values, (len(values), -1)).T, strict=True))


def specific_force(log: FlightLog) -> np.ndarray:
    """Return what an accelerometer reads, (n, 3) in B [m/s²]."""
    assert log.a is not None
    return attitude.rotate_back(log.q, log.a + [0.0, 0.0, 9.81])


def write_px4(path: Path, seed: int) -> None:
    """Write a PX4 log: NED and FRD, normalised collective thrust, no torque."""
    log, vehicle = flown(seed, Vehicle(), 0.3), Vehicle()
    q = attitude.multiply(
        attitude.multiply(np.tile(Q_NED, (len(log), 1)), log.q), np.tile(Q_FRD, (len(log), 1))
    )
    throttle = HOVER * np.maximum(log.u[:, 0] / (vehicle.mass * vehicle.gravity), 0.0) ** (1 / 1.5)
    setpoint = np.column_stack([0 * throttle, 0 * throttle, -throttle])
    streams = {
        "vehicle_local_position": columns(
            "x y z vx vy vz", np.hstack([log.p @ TO_NED.T, log.v @ TO_NED.T])
        ),
        "vehicle_attitude": columns("q[0] q[1] q[2] q[3]", q),
        "vehicle_angular_velocity": columns("xyz[0] xyz[1] xyz[2]", log.w * FRD),
        "sensor_combined": columns(
            "accelerometer_m_s2[0] accelerometer_m_s2[1] accelerometer_m_s2[2]",
            specific_force(log) * FRD,
        ),
        "vehicle_thrust_setpoint": columns("xyz[0] xyz[1] xyz[2]", setpoint),
        "battery_status": columns("voltage_v", 16.0 - 0.01 * log.t),
    }
    write = script("logs/formats/ulog_writer.py")["write"]
    write(path, {name: Stream(10.0 + log.t, content) for name, content in streams.items()})


def write_crazyflie(path: Path, seed: int) -> None:
    """Write a Crazyflie micro-SD log: degrees, g, rotor speed in rpm, one event."""
    log = flown(seed, CRAZYFLIE, 0.006)
    speed = np.sqrt(np.maximum(log.u @ CRAZYFLIE.unmixer.T, 0.0) / CRAZYFLIE.thrust_coefficient)
    content = columns(
        " ".join(f"stateEstimate.{name}" for name in ("x", "y", "z", "vx", "vy", "vz")),
        np.hstack([log.p, log.v]),
    )
    content |= columns("stateEstimate.qw stateEstimate.qx stateEstimate.qy stateEstimate.qz", log.q)
    content |= columns("gyro.x gyro.y gyro.z", np.degrees(log.w))
    content |= columns("acc.x acc.y acc.z", specific_force(log) / 9.80665)
    content |= columns("rpm.m1 rpm.m2 rpm.m3 rpm.m4", speed * 60 / (2 * np.pi))
    content |= columns("pm.vbat", 4.1 - 0.01 * log.t)
    write = script("logs/formats/crazyflie_writer.py")["write"]
    write(path, {"fixedFrequency": Stream(3.0 + log.t, content)})


def fill(folder: Path, px4: bool = True) -> None:
    """Write what a page of the guide reads from memory cards."""
    for number in (1, 2, 3):
        if px4:
            write_px4(folder / f"px4_{number}.ulg", number)
        write_crazyflie(folder / f"card0{number}", number)
