"""Flight plans drawn by chance: nine kinds of trajectory with random size, speed, height and
heading.
"""

from collections.abc import Callable

import numpy as np

from diagrams.challenge.simulators.flight_plan import Heading, Plan, within_limits
from np_drake.references.base import Hover, Reference, Sum
from np_drake.references.harmonic import Multisine, circle, lemniscate
from np_drake.references.waypoints import Spline, Stops
from np_drake.vehicle import Vehicle

RAMP = 3.0  # from rest to full speed on a closed track [s]
Draw = Callable[[np.random.Generator, float], Reference]


def _hover(rng: np.random.Generator, seconds: float) -> Reference:
    return Hover(rng.uniform([-1.0, -1.0, 0.8], [1.0, 1.0, 3.0]))


def _multisine(rng: np.random.Generator, amplitude: np.ndarray, pace: float) -> Reference:
    frequencies = pace * np.array([0.23, 0.41, 0.67, 0.97]) * rng.uniform(0.9, 1.1, 4)
    motion = Multisine(amplitude, frequencies=frequencies, ramp=RAMP, seed=int(rng.integers(2**31)))
    return Sum(Hover(np.array([0.0, 0.0, rng.uniform(1.6, 3.0)])), motion)


def _slow_multisine(rng: np.random.Generator, seconds: float) -> Reference:
    return _multisine(rng, rng.uniform(0.25, 0.8, 3) * [1, 1, 0.5], rng.uniform(0.4, 0.7))


def _aggressive_multisine(rng: np.random.Generator, seconds: float) -> Reference:
    return _multisine(rng, rng.uniform(0.5, 1.2, 3) * [1, 1, 0.4], rng.uniform(1.0, 1.5))


def _circle(rng: np.random.Generator, seconds: float) -> Reference:
    return circle(
        radius=rng.uniform(0.8, 3.0),
        height=rng.uniform(1.0, 3.0),
        speed=rng.uniform(1.0, 5.0),
        ramp=RAMP,
    )


def _lemniscate(rng: np.random.Generator, seconds: float) -> Reference:
    return lemniscate(
        length=rng.uniform(1.2, 3.5),
        width=rng.uniform(0.6, 1.8),
        height=rng.uniform(1.0, 3.0),
        speed=rng.uniform(1.0, 4.5),
        ramp=RAMP,
    )


def _stops(
    rng: np.random.Generator, points: list, seconds: float, lasting: tuple[float, float]
) -> Reference:
    """Return stops through `points` and back to the second, repeated, each move `lasting` between
    two times [s].
    """
    starts: list[float] = []
    durations: list[float] = []
    track, t = [points[0]], 0.5
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
    points = rng.uniform([-size, -size, 1.0], [size, size, 3.0], (len(times), 3))
    return Spline(points, times)


def _sprints(rng: np.random.Generator, seconds: float) -> Reference:
    course, reach = rng.uniform(-np.pi, np.pi), rng.uniform(1.5, 4.0)
    way, height = (
        reach * np.array([np.cos(course), np.sin(course), 0.0]),
        [0, 0, rng.uniform(1.0, 2.5)],
    )
    return _stops(rng, [height, height + way, height - way], seconds, (1.5, 3.0))


def _low_pass(rng: np.random.Generator, seconds: float) -> Reference:
    course, reach, low = rng.uniform(-np.pi, np.pi), rng.uniform(1.0, 3.0), rng.uniform(0.2, 0.5, 6)
    way = reach * np.array([np.cos(course), np.sin(course), 0.0])
    high = rng.uniform(1.0, 1.8)
    points = [
        way + [0, 0, high],
        way + [0, 0, low[0]],
        -way + [0, 0, low[1]],
        -way + [0, 0, low[2]],
    ]
    points += [
        way + [0, 0, low[3]],
        way + [0, 0, high],
        -way + [0, 0, low[4]],
        way + [0, 0, low[5]],
    ]
    return _stops(rng, points, seconds, (1.6, 3.0))


KINDS: dict[str, Draw] = {
    "hover": _hover,
    "slow_multisine": _slow_multisine,
    "aggressive_multisine": _aggressive_multisine,
    "circle": _circle,
    "lemniscate": _lemniscate,
    "vertical_steps": _vertical_steps,
    "waypoints": _waypoints,
    "sprints": _sprints,
    "low_pass": _low_pass,
}


def draw_plan(rng: np.random.Generator, vehicle: Vehicle, seconds: float, kind: str) -> Plan:
    """Draw one flight that a nominal vehicle can fly.

    Args:
        seconds: length [s].
        kind: one of `KINDS`.
    """
    reference = KINDS[kind](rng, seconds)
    return within_limits(Plan(kind, reference, _draw_heading(rng)), vehicle, seconds)


def draw_plans(
    rng: np.random.Generator, vehicle: Vehicle, seconds: float, flights: int
) -> list[Plan]:
    """Draw flights of different kinds, so that training and held-out flights differ; one hover in a
    case at most.

    Args:
        seconds: length of each [s].
    """
    kinds = rng.permutation(list(KINDS))[:flights]
    return [draw_plan(rng, vehicle, seconds, str(kind)) for kind in kinds]


def _draw_heading(rng: np.random.Generator) -> Heading:
    """Draw a heading: constant in half of the flights; else a slow turn or a swing."""
    start, manner = rng.uniform(-np.pi, np.pi), rng.integers(4)
    rate, swing, frequency = rng.uniform(-0.5, 0.5), rng.uniform(0.3, 1.0), rng.uniform(0.05, 0.15)
    if manner == 0:
        return Heading(start, rate=rate)
    return Heading(start, swing=swing, frequency=frequency) if manner == 1 else Heading(start)
