"""Random vehicles flown in Drake, with logs as real sensors write them: the truth against which to
identify.
"""

import dataclasses as dc

import numpy as np

from diagrams.batch.failed_run import FailedRun
from diagrams.challenge.flight import fly
from diagrams.challenge.plans import draw_plans
from diagrams.challenge.sensors import (
    REAL,
    draw_sensor_quality,
    kept_rows,
    rows_of,
    with_sensor_noise,
)
from np_drake import attitude
from np_drake.effects.blade_flapping import BladeFlapping
from np_drake.effects.calibration import effects_of
from np_drake.effects.linear_drag import LinearDrag
from np_drake.effects.translational_lift import TranslationalLift
from np_drake.flight_log import FlightLog
from np_drake.vehicle.calibration import Calibration, ThrottleMap
from np_drake.vehicle.physics import AIR, least_torque_over_thrust
from np_drake.vehicle.published import LogNormal, published_priors
from np_drake.vehicle.vehicle import MeasurementNoise, Vehicle

INPUTS = ("rotor_speed", "throttle", "command")
LIGHTEST, HEAVIEST = 0.03, 20.0  # [kg]
G = 9.81
# white noise of rotor speed, of hover [1]; that of telemetry of the flights by IMRCLab is 0.001
TACHOMETER = 0.002
SATURATED = (
    0.005  # share of rotor commands at a limit, from which a loop oscillates [1]; own choice
)
ATTEMPTS = 40  # draws of a vehicle until its controller flies it


@dc.dataclass(frozen=True)
class Truth:
    """A simulated vehicle.

    vehicle: its true parameters, calibration included.
    throttle: its map.
    imu: (3,) the accelerometer from Bo [m]. drag, flapping, lift: of the air.
    input: what its logs hold. known: what its owner knows: geometry and mass, with guesses for the
        rest.
    """

    vehicle: Vehicle
    throttle: ThrottleMap
    imu: np.ndarray
    drag: LinearDrag
    flapping: BladeFlapping
    lift: TranslationalLift
    input: str
    known: Vehicle

    def quantities(self, volts: float = 0.0) -> dict[str, float]:
        """Return the true values by the names of `np_drake.identification.quantities`.

        Args:
            volts: voltage to which full throttle refers [V]; 0: that of the vehicle.
        """
        v, c = self.vehicle, self.vehicle.calibration
        found = {
            "torque over thrust": v.torque_coefficient / v.thrust_coefficient,
            "inertia of a rotor": c.rotor_inertia,
            "drag, lateral": self.drag.d_x / v.mass,
            "drag, vertical": self.drag.d_z / v.mass,
            "lift of lateral speed": self.lift.lift / v.mass,
        }
        found |= {
            f"inertia {a}{b}": v.J["xyz".index(a), "xyz".index(b)]
            for a, b in ("xx", "yy", "zz", "xy", "xz", "yz")
        }
        found |= {f"centre of mass {a}": c.center_of_mass[i] for i, a in enumerate("xy")}
        found |= {f"gain of rotor {i + 1}": gain for i, gain in enumerate(c.rotor_gains)}
        found |= {f"IMU {a}": float(self.imu[i]) for i, a in enumerate("xyz")}
        found |= {f"IMU tilt {a}": c.imu_tilt[i] for i, a in enumerate("xyz")}
        if self.input == "rotor_speed":
            return found | {"thrust coefficient": v.thrust_coefficient, "clock of the state": 0.0}
        found |= {
            "time constant up": v.rotor_time_constant,
            "time constant down": v.rotor_time_constant,
            "transport delay": c.command_delay,
        }
        if self.input == "command":
            return found | {"logged thrust, true over logged": 1.0}
        return found | {
            "thrust at full throttle": float(self.throttle.thrust(1.0, volts or None)),
            "linear share of throttle": self.throttle.linear,
            "power of the voltage": self.throttle.voltage_exponent,
        }


def _spread(rng: np.random.Generator, mean: float, sd: float) -> float:
    """Return a uniform draw with this mean and standard deviation."""
    return float(mean + np.sqrt(3.0) * sd * rng.uniform(-1.0, 1.0))


def _drawn(rng: np.random.Generator, spread: LogNormal) -> float:
    """Return a uniform draw of the logarithm with the mean and deviation of published vehicles."""
    return float(np.exp(_spread(rng, spread.mean, spread.deviation)))


def draw_truth(rng: np.random.Generator, kind: str) -> Truth:
    """Draw a vehicle.

    Args:
        kind: of input, one of `INPUTS`.
    """
    mass = float(np.exp(rng.uniform(np.log(LIGHTEST), np.log(HEAVIEST))))
    arm = float(rng.uniform(0.13, 0.2)) * mass ** (1 / 3)
    x, y = arm * np.sin(angle := rng.uniform(0.65, 0.92)), arm * np.cos(angle)
    radius = float(rng.uniform(0.4, 0.65)) * arm
    number = float(rng.uniform(0.06, 0.18))
    k = number * AIR * (2 * radius) ** 4 / (2 * np.pi) ** 2
    lever = least_torque_over_thrust(number, 2 * radius) / rng.uniform(0.4, 0.7)
    told = published_priors()
    xx = mass * arm**2 * _drawn(rng, told.inertia)
    yy = xx * _drawn(rng, told.inertia_pitch)
    zz = (xx + yy) * min(_drawn(rng, told.inertia_yaw), 0.98)
    off = np.array([_spread(rng, 0.0, 0.02) for _ in range(3)])
    mean = 0.5 * (xx + yy)
    J = np.diag([xx, yy, zz])
    for (i, j), value in zip(((0, 1), (0, 2), (1, 2)), off, strict=True):
        J[i, j] = J[j, i] = -mean * value
    gains = 1.0 + np.array([_spread(rng, 0.0, 0.02) for _ in range(4)])
    calibration = Calibration(
        center_of_mass=[_spread(rng, 0.0, 0.03) * arm, _spread(rng, 0.0, 0.03) * arm, 0.0],
        rotor_gains=[float(g) for g in gains / gains.mean()],
        command_delay=float(rng.uniform(0.0, 0.015)),
        rotor_inertia=float(mass * arm**2 * min(_drawn(rng, told.rotor_inertia), 2e-3)),
        imu_position=[_spread(rng, 0.0, 0.1) * arm for _ in range(3)],
        imu_tilt=[_spread(rng, 0.0, 0.015) for _ in range(3)],
    )
    strongest = float(rng.uniform(1.9, 3.5)) * 0.25 * mass * G
    throttle = ThrottleMap(
        strongest, float(rng.uniform(0.0, 0.4)), 0.0, 3.7, float(rng.uniform(1.0, 2.0))
    )
    lag = float(np.clip(_drawn(rng, told.time_constant), 0.012, 0.07))
    directions = [1.0, -1.0, 1.0, -1.0] if rng.integers(2) else [-1.0, 1.0, -1.0, 1.0]
    positions = [[x, y, 0.0], [x, -y, 0.0], [-x, -y, 0.0], [-x, y, 0.0]]
    vehicle = Vehicle(
        name="simulated",
        mass=mass,
        inertia=J.tolist(),
        rotor_positions=positions,
        rotor_directions=directions,
        thrust_coefficient=float(k),
        torque_coefficient=float(lever * k),
        rotor_radius=radius,
        max_rotor_thrust=strongest,
        rotor_time_constant=lag,
        throttle=throttle,
        calibration=calibration,
        command_timing="held",
        measurement_noise=MeasurementNoise(),
    ).check()
    drag = mass * rng.uniform(0.05, 0.3)
    dragging = LinearDrag(drag, drag, mass * float(rng.uniform(0.05, 0.3)))
    flapping = BladeFlapping(float(mass * arm * rng.uniform(0.0, 0.15)))
    lift = TranslationalLift(float(mass * rng.uniform(0.0, 0.03)))
    known = dc.replace(
        vehicle,
        inertia=np.diag([0.3 * mass * arm**2] * 2 + [0.5 * mass * arm**2]).tolist(),
        rotor_time_constant=0.0,
        calibration=Calibration(),
        throttle=None,
        thrust_coefficient=1.4 * float(k),
        torque_coefficient=1.4 * float(lever * k),
    ).check()
    imu = np.array(calibration.imu_position)
    return Truth(vehicle, throttle, imu, dragging, flapping, lift, kind, known)


def fly_truth(
    truth: Truth, rng: np.random.Generator, flights: int, seconds: float
) -> list[FlightLog]:
    """Return logs of ordinary flights.

    Args:
        seconds: length of each [s].
    """
    v = truth.vehicle
    spin = float(np.sqrt(0.25 * v.mass * G / v.thrust_coefficient))
    effects = effects_of(dc.replace(v.calibration, imu_tilt=[0.0, 0.0, 0.0], clock_offset=0.0), v)
    logs, white = [], v.measurement_noise
    for number, plan in enumerate(draw_plans(rng, v, seconds, flights)):
        # The accelerometer's reading is turned to W by the attitude of the log.
        quality = dc.replace(
            draw_sensor_quality(REAL, rng, spin), rotor=TACHOMETER * spin, turned=True
        )
        seen = np.array([0.002] * 3 + [0.0, *[0.003] * 3] + [0.02] * 3 + [white.rate] * 3)
        exact = fly(
            v,
            plan,
            (*effects, truth.drag, truth.flapping, truth.lift),
            t=quality.instants(rng, seconds),
            noise=seen,
        )
        thrust = exact.u @ v.unmixer.T
        limited = (thrust < 0.01 * v.max_rotor_thrust) | (thrust > 0.99 * v.max_rotor_thrust)
        if np.mean(limited) > SATURATED:
            raise FailedRun(
                "identification: no ordinary flight: the loop of this vehicle oscillates."
            )
        logs.append(_as_logged(exact, truth, quality, rng, f"flight{number}"))
    return logs


def draw_and_fly(
    seed: int, kind: str, flights: int, seconds: float
) -> tuple[Truth, list[FlightLog]]:
    """Return a vehicle and its logs, drawn until its controller flies it without oscillation.

    Args:
        seconds: length of each [s].
    Raises: FailedRun: if no draw can be flown.
    """
    for attempt in range(ATTEMPTS):
        rng = np.random.default_rng((seed, attempt))
        truth = draw_truth(rng, kind)
        try:
            return truth, fly_truth(truth, rng, flights, seconds)
        except FailedRun:
            continue
    raise FailedRun(f"identification: no vehicle of seed {seed} could be flown.")


def _as_logged(
    exact: FlightLog, truth: Truth, quality, rng: np.random.Generator, name: str
) -> FlightLog:
    """Return a flight as the sensors of the vehicle log it."""
    v, g = truth.vehicle, np.array([0.0, 0.0, G])
    # The accelerometer averages over the interval after a row: the change of its velocity.
    velocity = exact.v + attitude.rotate(exact.q, np.cross(exact.w, truth.imu))
    rate = np.diff(velocity, axis=0) / np.diff(exact.t)[:, None]
    half = attitude.rotation_vector(
        attitude.multiply(attitude.conjugate(exact.q[:-1]), exact.q[1:])
    )
    middle = attitude.multiply(exact.q[:-1], attitude.from_rotation_vector(0.5 * half))
    force = attitude.rotate_back(middle, rate + g)
    force = np.concatenate([force, force[-1:]])
    moved = dc.replace(exact, a=attitude.rotate(exact.q, force) - g)
    log = with_sensor_noise(moved, v, quality, rng)
    turn = attitude.from_rotation_vector(np.array([v.calibration.imu_tilt]))[0]
    turns = np.broadcast_to(turn, log.q.shape)
    force = attitude.rotate_back(turns, attitude.rotate_back(log.q, log.a + g))
    log = dc.replace(
        log,
        a=attitude.rotate(log.q, force) - g,
        w=attitude.rotate_back(turns, log.w),
        al=None,
        name=name,
    )
    log = rows_of(log, kept_rows(rng, quality, len(log)))
    if truth.input == "rotor_speed":
        return dc.replace(log, input="rotor_speed")
    if truth.input == "command":
        return dc.replace(log, rotor=None)
    sagging = np.linspace(4.0, 3.5, len(log)) + 0.02 * rng.normal()
    wanted = np.maximum(log.u @ v.unmixer.T, 0.0)
    throttle = truth.throttle.throttle(wanted, sagging[:, None])
    return dc.replace(log, rotor=None, throttle=throttle, voltage=sagging, input="normalised")
