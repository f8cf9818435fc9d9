"""Flight plans: where to fly and which way to look, drawn by chance in nine kinds."""

import dataclasses as dc
from collections.abc import Callable
from functools import partial

import numpy as np

from np_drake import attitude
from np_drake.references.base import Hover, Paced, Reference, Sum
from np_drake.references.harmonic import Multisine, circle, lemniscate
from np_drake.references.waypoints import Spline, Stops
from np_drake.vehicle import Vehicle

RAMP = 3.0  # from rest to full speed on a closed track [s]
_DELTA = 2e-3  # of the central differences from attitude to rate and angular acceleration [s]
# Share of the largest thrust that a plan may ask of a rotor: the rest is for surprises.
ROTOR_SHARE = (0.08, 0.62)
FASTEST = 8.0  # [m/s]
STEEPEST = 0.75  # tilt [rad]


@dc.dataclass(frozen=True)
class Heading:
    """A heading from rest: yaw = start + rate t + swing (1 - cos 2 pi frequency t) / 2 [rad, rad/s,
    Hz].
    """

    start: float = 0.0
    rate: float = 0.0
    swing: float = 0.0
    frequency: float = 0.1

    def sample(self, t: np.ndarray) -> np.ndarray:
        """Return the yaw (n,) [rad]; the turn sets in over a second."""
        after = np.maximum(t, 0.0)
        turned = np.where(after < 1.0, 0.5 * after**2, after - 0.5)
        swung = 0.5 * self.swing * (1 - np.cos(2 * np.pi * self.frequency * after))
        return self.start + self.rate * turned + swung


@dc.dataclass(frozen=True)
class Plan:
    """One flight as planned; times (n,) are in s."""

    kind: str
    reference: Reference
    heading: Heading = dc.field(default_factory=Heading)

    def start(self, gravity: float) -> np.ndarray:
        """Return the state (13,) at rest, before and at t = 0."""
        zero = np.zeros(1)
        place = self.reference.sample(zero)[0, 0]
        q = self._attitude(gravity, zero)[0]
        return np.concatenate([place, q, np.zeros(6)])

    def targets(self, gravity: float, t: np.ndarray) -> np.ndarray:
        """Return the targets (n, 16) of `np_drake.control.cascade`."""
        p, v, a = self.reference.sample(t)[:3]
        sooner, now, later = (self._rate(gravity, t + shift) for shift in (-_DELTA, 0.0, _DELTA))
        al = (later - sooner) / (2 * _DELTA)
        return np.concatenate([p, v, a, now, al, self.heading.sample(t)[:, None]], axis=1)

    def _attitude(self, gravity: float, t: np.ndarray) -> np.ndarray:
        force = self.reference.sample(t)[2] + [0.0, 0.0, gravity]
        z_B_W = force / np.linalg.norm(force, axis=1, keepdims=True)
        return attitude.quaternion_from_axes(z_B_W, self.heading.sample(t))

    def _rate(self, gravity: float, t: np.ndarray) -> np.ndarray:
        """Return the body rates (n, 3) of the attitude that the plan needs [rad/s]."""
        # Central difference on the rotation group: vector part of q(t - d)* q(t + d) over d.
        sooner = self._attitude(gravity, t - _DELTA)
        later = self._attitude(gravity, t + _DELTA)
        turn = attitude.multiply(attitude.conjugate(sooner), later)
        return turn[:, 1:] * np.sign(turn[:, :1]) / _DELTA

    def rotor_thrust(self, vehicle: Vehicle, t: np.ndarray) -> np.ndarray:
        """Return the rotor thrusts (n, 4) that the plan asks of a nominal vehicle [N]."""
        target = self.targets(vehicle.gravity, t)
        a = target[:, 6:9]
        w = target[:, 9:12]
        al = target[:, 12:15]
        f = vehicle.mass * np.linalg.norm(a + [0.0, 0.0, vehicle.gravity], axis=1, keepdims=True)
        tau = al @ vehicle.J.T + np.cross(w, w @ vehicle.J.T)
        return np.concatenate([f, tau], axis=1) @ vehicle.unmixer.T

    def within_limits(self, vehicle: Vehicle, seconds: float) -> "Plan":
        """Return the plan, slowed down until a nominal vehicle can fly it for that time [s].

        Raises: ValueError: if no pace is slow enough.
        """
        t = np.arange(0.0, seconds, 0.02)
        low, high = np.array(ROTOR_SHARE) * vehicle.max_rotor_thrust
        for factor in 0.9 ** np.arange(25):
            slow = dc.replace(self, reference=Paced(self.reference, float(factor)))
            thrust = slow.rotor_thrust(vehicle, t)
            v, a = slow.reference.sample(t)[1:3]
            level = np.linalg.norm(a[:, :2], axis=1)
            lift = a[:, 2] + vehicle.gravity
            gentle = np.all(level <= np.tan(STEEPEST) * lift)
            slow_enough = np.linalg.norm(v, axis=1).max() <= FASTEST
            if gentle and slow_enough and low <= thrust.min() and thrust.max() <= high:
                return slow
        raise ValueError(
            f"within_limits: {vehicle.name} must be able to fly the plan {self.kind!r} at some "
            "pace."
        )


def _hover(rng: np.random.Generator, seconds: float) -> Reference:
    return Hover(rng.uniform([-1.0, -1.0, 0.8], [1.0, 1.0, 3.0]))


def _multisine(sizes: tuple, rise: float, paces: tuple, rng, seconds: float) -> Reference:
    """Return a multisine of amplitudes [m], with `rise` of them upwards, and paces between
    bounds.
    """
    amplitude = rng.uniform(*sizes, 3) * [1, 1, rise]
    pace = rng.uniform(*paces)
    frequencies = pace * np.array([0.23, 0.41, 0.67, 0.97]) * rng.uniform(0.9, 1.1, 4)
    motion = Multisine(amplitude, frequencies=frequencies, ramp=RAMP, seed=int(rng.integers(2**31)))
    return Sum(Hover(np.array([0.0, 0.0, rng.uniform(1.6, 3.0)])), motion)


def _closed(track: Callable, bounds: dict, rng: np.random.Generator, seconds: float) -> Reference:
    """Return a closed track whose figures lie between bounds [m, m/s]."""
    return track(**{name: rng.uniform(*span) for name, span in bounds.items()}, ramp=RAMP)


def _stops(
    rng: np.random.Generator, points: list, seconds: float, lasting: tuple[float, float]
) -> Reference:
    """Return stops through `points` and back to the second, repeated, each move `lasting` between
    two times [s].
    """
    starts: list[float] = []
    durations: list[float] = []
    track = [points[0]]
    t = 0.5
    while t < seconds:
        duration = rng.uniform(*lasting)
        track.append(points[1 + len(starts) % (len(points) - 1)])
        starts.append(t)
        durations.append(duration)
        t += duration + rng.uniform(0.0, 0.6)
    return Stops(np.array(track), np.array(starts), np.array(durations))


def _vertical_steps(rng: np.random.Generator, seconds: float) -> Reference:
    heights = rng.uniform(0.6, 3.5, 8)
    place = rng.uniform(-1, 1, 2)
    return _stops(rng, [[*place, height] for height in heights], seconds, (0.9, 2.2))


def _waypoints(rng: np.random.Generator, seconds: float) -> Reference:
    intervals = rng.uniform(1.0, 2.2, int(seconds) + 3)
    intervals[[0, -1]] += 2.0  # rest to motion takes its time
    times = np.concatenate([[0.0], np.cumsum(intervals)])
    size = rng.uniform(1.0, 2.5)
    return Spline(rng.uniform([-size, -size, 1.0], [size, size, 3.0], (len(times), 3)), times)


def level_direction(rng: np.random.Generator) -> tuple[float, float, float]:
    """Draw a level unit vector."""
    course = rng.uniform(-np.pi, np.pi)
    return float(np.cos(course)), float(np.sin(course)), 0.0


def _sprints(rng: np.random.Generator, seconds: float) -> Reference:
    way = np.array(level_direction(rng)) * rng.uniform(1.5, 4.0)
    height = [0, 0, rng.uniform(1.0, 2.5)]
    return _stops(rng, [height, height + way, height - way], seconds, (1.5, 3.0))


def _low_pass(rng: np.random.Generator, seconds: float) -> Reference:
    way = np.array(level_direction(rng)) * rng.uniform(1.0, 3.0)
    low = rng.uniform(0.2, 0.5, 6)
    high = rng.uniform(1.0, 1.8)
    sides = (1, 1, -1, -1, 1, 1, -1, 1)
    heights = (high, low[0], low[1], low[2], low[3], high, low[4], low[5])
    points = [side * way + [0, 0, z] for side, z in zip(sides, heights, strict=True)]
    return _stops(rng, points, seconds, (1.6, 3.0))


KINDS: dict[str, Callable[[np.random.Generator, float], Reference]] = {
    "hover": _hover,
    "slow_multisine": partial(_multisine, (0.25, 0.8), 0.5, (0.4, 0.7)),
    "aggressive_multisine": partial(_multisine, (0.5, 1.2), 0.4, (1.0, 1.5)),
    "circle": partial(
        _closed, circle, {"radius": (0.8, 3.0), "height": (1.0, 3.0), "speed": (1.0, 5.0)}
    ),
    "lemniscate": partial(
        _closed,
        lemniscate,
        {"length": (1.2, 3.5), "width": (0.6, 1.8), "height": (1.0, 3.0), "speed": (1.0, 4.5)},
    ),
    "vertical_steps": _vertical_steps,
    "waypoints": _waypoints,
    "sprints": _sprints,
    "low_pass": _low_pass,
}


def draw_plan(rng: np.random.Generator, vehicle: Vehicle, seconds: float, kind: str) -> Plan:
    """Draw one flight of a kind of `KINDS` that a nominal vehicle can fly for that time [s]."""
    reference = KINDS[kind](rng, seconds)
    return Plan(kind, reference, _draw_heading(rng)).within_limits(vehicle, seconds)


def draw_plans(
    rng: np.random.Generator, vehicle: Vehicle, seconds: float, flights: int
) -> list[Plan]:
    """Draw flights of different kinds, so that training and held-out flights differ; one hover in a
    case at most.
    """
    kinds = rng.permutation(list(KINDS))[:flights]
    return [draw_plan(rng, vehicle, seconds, str(kind)) for kind in kinds]


def _draw_heading(rng: np.random.Generator) -> Heading:
    """Draw a heading: constant in half of the flights; else a slow turn or a swing."""
    start = rng.uniform(-np.pi, np.pi)
    manner = rng.integers(4)
    rate = rng.uniform(-0.5, 0.5)
    swing = rng.uniform(0.3, 1.0)
    frequency = rng.uniform(0.05, 0.15)
    if manner == 0:
        return Heading(start, rate=rate)
    return Heading(start, swing=swing, frequency=frequency) if manner == 1 else Heading(start)
