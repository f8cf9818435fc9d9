"""Flights in closed form: the motion is prescribed, and the rotors follow from Newton and Euler."""

import dataclasses as dc

import numpy as np

from np_drake import attitude
from np_drake.flight_log import FlightLog
from np_drake.identification.signals import interpolated
from np_drake.vehicle import Vehicle
from np_drake.vehicle.vehicle import Calibration, ThrottleMap

G = 9.81
FINE = 8  # steps in an interval of rows
NOISE = {"w": 0.002, "a": 0.03, "rotor": 0.3}  # [rad/s, m/s², rad/s]

TRUE = Vehicle(
    name="true",
    mass=1.3,
    inertia=[[0.011, -0.0002, 0.0001], [-0.0002, 0.013, 0.00015], [0.0001, 0.00015, 0.02]],
    rotor_positions=[
        [0.12, 0.14, 0.0],
        [0.12, -0.14, 0.0],
        [-0.12, -0.14, 0.0],
        [-0.12, 0.14, 0.0],
    ],
    rotor_directions=[1.0, -1.0, 1.0, -1.0],
    thrust_coefficient=9e-6,
    torque_coefficient=1.9e-7,
    max_rotor_thrust=10.0,
    rotor_time_constant=0.03,
    throttle=ThrottleMap(10.0, 0.2),
    calibration=Calibration(
        center_of_mass=[0.003, -0.002, 0.0],
        rotor_gains=[1.01, 0.99, 1.015, 0.985],
        rotor_time_constant_down=0.04,
        command_delay=0.008,
        rotor_inertia=4e-6,
        imu_position=[0.01, -0.012, 0.008],
        imu_tilt=[0.03, -0.02, 0.015],
    ),
).check()
KNOWN = dc.replace(
    TRUE,
    name="known",
    inertia=np.diag([0.02, 0.02, 0.035]).tolist(),
    thrust_coefficient=1.2e-5,
    torque_coefficient=2e-7,
    rotor_time_constant=0.0,
    throttle=None,
    calibration=Calibration(),
).check()


def _waves(rng: np.random.Generator, t: np.ndarray, size: float, low: float, high: float):
    """Return three multisines (n, 3) and their derivatives."""
    f, phase = rng.uniform(low, high, (6, 3)), rng.uniform(0, 2 * np.pi, (6, 3))
    angle = 2 * np.pi * f * t[:, None, None] + phase
    size = size / np.sqrt(3)
    return (size * np.sin(angle)).sum(1), (size * 2 * np.pi * f * np.cos(angle)).sum(1)


def _attitudes(w: np.ndarray, h: float) -> np.ndarray:
    """Return the attitudes (n, 4) of body rates w (n, 3)."""
    turns = attitude.from_rotation_vector(0.5 * h * (w[1:] + w[:-1]))
    shift = 1
    while shift < len(turns):
        turns = np.concatenate([turns[:shift], attitude.multiply(turns[:-shift], turns[shift:])])
        shift *= 2
    return np.concatenate([[[1.0, 0.0, 0.0, 0.0]], turns])


def _sum(values: np.ndarray, h: float) -> np.ndarray:
    """Return the integral by the trapezoidal rule, from zero."""
    return np.concatenate([0 * values[:1], np.cumsum(0.5 * h * (values[1:] + values[:-1]), axis=0)])


def flight(
    vehicle: Vehicle = TRUE,
    seed: int = 0,
    *,
    seconds: float = 20.0,
    rate: float = 100.0,
    size: float = 1.0,
    drag: float = 0.1,
    clock: float = 0.0,
    drive: str = "rotor_speed",
    noisy: bool = True,
) -> FlightLog:
    """Return a flight whose rotors do exactly what its motion needs.

    size: RMS of roll and pitch rates [rad/s]; drag: over mass [1/s]; clock: by which the rotors'
    telemetry is ahead [s]; drive: rotor_speed, throttle, command or both (speed and throttle).
    """
    rng, c = np.random.default_rng(seed), vehicle.calibration
    rows, h = round(seconds * rate), 1 / rate / FINE
    margin = 2 * FINE * max(1, round(0.03 * rate))  # of time beyond both ends
    t = np.arange(-margin, rows * FINE + margin) * h
    w, alpha = (values * [1.0, 1.0, 0.2] for values in _waves(rng, t, size, 0.4, 2.5))
    q = _attitudes(w, h)
    lift = G * (1.0 + 0.15 * size * _waves(rng, t, 1.0, 0.4, 2.5)[0][:, 0])
    speed, spin, hover, v = _solve(vehicle, (t, h, w, alpha, q, lift), drag)
    own = slice(margin, margin + rows * FINE, FINE)
    center, imu = np.array(c.center_of_mass), np.array(c.imu_position or [0.0, 0.0, 0.0])
    arm = imu - center
    body = attitude.rotate_back(q, v - attitude.rotate(q, np.cross(w, center)))
    force = -drag * spin[:, None] * body + np.cross(alpha, arm) + np.cross(w, np.cross(w, arm))
    force[:, 2] += lift
    force = _mean(force, margin, rows)
    turn = np.broadcast_to(attitude.from_rotation_vector(np.array(c.imu_tilt)), (rows, 4))
    force = attitude.rotate_back(turn, force)
    place = _sum(v, h) - attitude.rotate(q, np.broadcast_to(center, w.shape))
    velocity = v - attitude.rotate(q, np.cross(w, center))
    noise = {k: s * noisy for k, s in NOISE.items()}
    seen = attitude.rotate_back(turn, w[own]) + noise["w"] * rng.normal(size=(rows, 3))
    force = force + noise["a"] * rng.normal(size=(rows, 3))
    k = vehicle.thrust_coefficient
    log = FlightLog(
        t=t[own],
        p=place[own],
        q=q[own],
        v=velocity[own],
        w=seen,
        u=np.zeros((rows, 4)),
        a=attitude.rotate(q[own], force) - [0.0, 0.0, G],
        name=f"flight{seed}",
    )
    if drive in ("rotor_speed", "both"):
        at = interpolated(t[own] + clock, t, speed) * hover
        at = at + noise["rotor"] * rng.normal(size=at.shape)
        log = dc.replace(log, rotor=at, u=k * at**2 @ vehicle.mixer.T, input="rotor_speed")
    if drive == "rotor_speed":
        return log
    wanted = hover * _commands(vehicle, t, speed, t[own], 1 / rate)
    thrust = k * wanted**2
    if drive == "command":
        return dc.replace(log, u=thrust @ KNOWN.mixer.T)  # what the autopilot means by it
    throttle = vehicle.throttle.throttle(thrust)
    return dc.replace(
        log, throttle=throttle, input="rotor_speed" if drive == "both" else "normalised"
    )


def collective_flight(**options) -> FlightLog:
    """Return a flight of which a collective command is logged: 0.06 and 0.44 of thrust over
    weight.
    """
    log = flight(drive="command", **options)
    command = 0.06 + 0.44 * log.u[:, :1] / (TRUE.mass * G)
    return dc.replace(log, u=np.full(log.u.shape, np.nan), throttle=command, input="normalised")


def _solve(vehicle: Vehicle, motion: tuple, drag: float):
    """Return relative speeds (n, 4), their mean (n,), speed in hover [rad/s] and velocity (n, 3) of
    the mass.
    """
    t, h, w, alpha, q, lift = motion
    c, J, m = vehicle.calibration, vehicle.J, vehicle.mass
    hover = np.sqrt(0.25 * m * G / vehicle.thrust_coefficient)
    center, d = np.array(c.center_of_mass), np.array(vehicle.rotor_directions)
    p = np.array(vehicle.rotor_positions) - center
    kappa = vehicle.torque_coefficient / vehicle.thrust_coefficient
    mixer = (
        np.stack([np.ones(4), p[:, 1], -p[:, 0], kappa * d])
        * np.array(c.rotor_gains)
        * 0.25
        * m
        * G
    )
    speed, v = np.ones((len(t), 4)), np.zeros((len(t), 3))
    turn = attitude.rotate(q, np.cross(w, center))
    apart = max(
        1, round(0.005 / h)
    )  # of a difference quotient that does not feed rounding errors back
    for _ in range(5):
        spin = speed.mean(axis=1)
        push = attitude.rotate(q, lift[:, None] * [0.0, 0.0, 1.0]) - [0.0, 0.0, G]
        decay = np.exp(_sum(drag * spin, h))[:, None]
        v = _sum(decay * (push + (drag * spin)[:, None] * turn), h) / decay
        air = -m * drag * spin[:, None] * attitude.rotate_back(q, v - turn)
        H = c.rotor_inertia * hover * (speed @ d)
        torque = alpha @ J.T + np.cross(w, w @ J.T) - np.cross(-center, air)
        torque[:, 0] -= w[:, 1] * H
        torque[:, 1] += w[:, 0] * H
        torque[apart:-apart, 2] -= (H[2 * apart :] - H[: -2 * apart]) / (2 * apart * h)
        wrench = np.concatenate([m * lift[:, None], torque], axis=1)
        speed = np.sqrt(wrench @ np.linalg.inv(mixer).T)
    return speed, speed.mean(axis=1), hover, v


def _mean(values: np.ndarray, margin: int, rows: int) -> np.ndarray:
    """Return the means (rows, c) over the intervals after the rows."""
    edges = values[margin : margin + rows * FINE + 1]
    middle = 0.5 * (edges[1:] + edges[:-1])
    return middle.reshape(rows, FINE, -1).mean(axis=1)


def _commands(
    vehicle: Vehicle, t: np.ndarray, speed: np.ndarray, rows: np.ndarray, step: float
) -> np.ndarray:
    """Return the speeds to command (n, 4), relative, with which the lag passes through the speeds
    at the rows.
    """
    up, down = vehicle.rotor_time_constant, vehicle.calibration.rotor_time_constant_down
    here, after = (
        interpolated(rows + late + vehicle.calibration.command_delay, t, speed)
        for late in (0.0, step)
    )
    share = np.where(after > here, np.exp(-step / up), np.exp(-step / down))
    return (after - here * share) / (1.0 - share)
