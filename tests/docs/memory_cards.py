"""Memory cards of the guide: simulated flights as PX4 and Crazyflie logs, in the conventions of
those formats.
"""

import importlib.util
from pathlib import Path
from types import ModuleType

import numpy as np

from np_drake import attitude
from np_drake.effects.linear_drag import LinearDrag
from np_drake.flight_log import FlightLog
from np_drake.logs.formats.format import Stream
from np_drake.vehicle import Vehicle

TESTS = Path(__file__).parents[1]
HOVER = 0.41  # throttle
TO_NED = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
Q_NED = np.array([0.0, np.sqrt(0.5), np.sqrt(0.5), 0.0])
Q_FRD = np.array([0.0, 1.0, 0.0, 0.0])
FRD = np.array([1.0, -1.0, -1.0])
CRAZYFLIE = Vehicle(
    name="crazyflie",
    mass=0.0397,
    inertia=[[1.9e-5, 0.0, 0.0], [0.0, 1.9e-5, 0.0], [0.0, 0.0, 3.2e-5]],
    rotor_positions=[
        [0.0325, -0.0325, 0],
        [-0.0325, -0.0325, 0],
        [-0.0325, 0.0325, 0],
        [0.0325, 0.0325, 0],
    ],
    rotor_directions=[-1.0, 1.0, -1.0, 1.0],
    thrust_coefficient=3.704e-8,
    torque_coefficient=2.2e-10,
    rotor_radius=0.025,
    max_rotor_thrust=0.25,
)


def module(path: Path) -> ModuleType:
    """Return a module of the tests by its file."""
    spec = importlib.util.spec_from_file_location(path.stem, path)
    assert spec is not None
    assert spec.loader is not None
    found = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(found)
    return found


def flown(seed: int, vehicle: Vehicle, drag: float) -> FlightLog:
    """Return a flight under drag [N·s/m], with noise."""
    simulated = module(TESTS / "np_drake" / "diagnosis" / "simulated_flights.py")
    log: FlightLog = simulated.fly(
        LinearDrag(drag, drag, drag), seed=seed, seconds=9.0, noise=1.0, vehicle=vehicle
    )
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
    writer = module(TESTS / "np_drake" / "logs" / "formats" / "ulog_writer.py")
    writer.write(path, {name: Stream(10.0 + log.t, content) for name, content in streams.items()})


def write_crazyflie(path: Path, seed: int) -> None:
    """Write a Crazyflie micro-SD log: degrees, g, rotor speed in rpm, one event."""
    log = flown(seed, CRAZYFLIE, 0.006)
    speed = np.sqrt(np.maximum(log.u @ CRAZYFLIE.unmixer.T, 0.0) / CRAZYFLIE.thrust_coefficient)
    content = columns(
        (
            "stateEstimate.x stateEstimate.y stateEstimate.z stateEstimate.vx stateEstimate.vy "
            "stateEstimate.vz"
        ),
        np.hstack([log.p, log.v]),
    )
    content |= columns("stateEstimate.qw stateEstimate.qx stateEstimate.qy stateEstimate.qz", log.q)
    content |= columns("gyro.x gyro.y gyro.z", np.degrees(log.w))
    content |= columns("acc.x acc.y acc.z", specific_force(log) / 9.80665)
    content |= columns("rpm.m1 rpm.m2 rpm.m3 rpm.m4", speed * 60 / (2 * np.pi))
    content |= columns("pm.vbat", 4.1 - 0.01 * log.t)
    writer = module(TESTS / "np_drake" / "logs" / "formats" / "crazyflie_writer.py")
    writer.write(path, {"fixedFrequency": Stream(3.0 + log.t, content)})


def write_table(path: Path, seed: int) -> None:
    """Write the table of the guide's map: NED and FRD, milliseconds, degrees, g."""
    log = flown(seed, Vehicle(), 0.3)
    q = attitude.multiply(
        attitude.multiply(np.tile(Q_NED, (len(log), 1)), log.q), np.tile(Q_FRD, (len(log), 1))
    )
    content = columns("time_ms", 1e3 * log.t)
    content |= columns("n e d vn ve vd", np.hstack([log.p @ TO_NED.T, log.v @ TO_NED.T]))
    content |= columns("qw qx qy qz", q)
    content |= columns("p q r", np.degrees(log.w * FRD))
    content |= columns("acc_x acc_y acc_z", specific_force(log) * FRD / 9.80665)
    content |= columns("lift", log.u[:, 0])
    rows = np.stack(list(content.values()), axis=1)
    np.savetxt(path, rows, delimiter=",", header=",".join(content), comments="", fmt="%.9g")


def fill(folder: Path, crazyflie_flights: list[Path] | None = None) -> None:
    """Write what the guide reads from memory cards; crazyflie_flights: real ones in the place of
    made ones.
    """
    for number in (1, 2, 3):
        write_px4(folder / f"px4_{number}.ulg", number)
        card = folder / f"card0{number}"
        if crazyflie_flights:
            card.write_bytes(crazyflie_flights[number - 1].read_bytes())
        else:
            write_crazyflie(card, number)
    write_table(folder / "flight.csv", 4)
