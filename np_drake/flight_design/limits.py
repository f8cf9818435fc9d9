"""Limits of room, vehicle and payload on a motion, and how much of each a motion uses."""

import dataclasses as dc
from collections.abc import Sequence
from functools import lru_cache

import numpy as np
from scipy import signal

from np_drake.effects.combine import mass_properties, split_effects
from np_drake.effects.explanation import Explanation
from np_drake.effects.pendulum import Payload
from np_drake.references.flatness import targets
from np_drake.vehicle import Vehicle

WALL = 0.3  # distance that Bo keeps from walls, floor and ceiling [m]; own choice
CLEAR = 0.15  # distance of a hanging payload from the floor [m]; own choice
MOST_THRUST, LEAST_THRUST = (
    0.95,
    0.05,
)  # of a rotor, over its largest and over that of hover [1]; own choice
MOST_SWING = 0.8  # angle of a payload's tether from vertical [rad]; own choice
DAMPING = 0.02  # damping ratio of a payload's swing [1]; own choice: hardly any


@dc.dataclass(frozen=True)
class Limits:
    """Largest values that a motion may reach in any of the explanations.

    lower, upper: (3,) of the position of Bo in W [m].   speed: [m/s].   tilt: of body z [rad].
    load: (least, most) thrust that is needed over the nominal one, of the explanations [1].
    payloads: that may hang below.   swing: of their tethers [rad].
    """

    vehicle: Vehicle
    lower: np.ndarray
    upper: np.ndarray
    speed: float
    tilt: float
    load: tuple[float, float] = (1.0, 1.0)
    payloads: tuple[Payload, ...] = ()
    swing: float = MOST_SWING

    @property
    def center(self) -> np.ndarray:
        """Middle (3,) of the room that Bo may use, where a flight begins [m]."""
        return 0.5 * (self.lower + self.upper)

    @property
    def half(self) -> np.ndarray:
        """Half of the room that Bo may use, (3,) [m]."""
        return 0.5 * (self.upper - self.lower)

    @property
    def box(self) -> np.ndarray:
        """Room (3,) along x, y, z that these limits are for [m]."""
        return np.array([*(self.upper - self.lower)[:2] + 2 * WALL, self.upper[2] + WALL])

    def usage(self, t: np.ndarray, flat: np.ndarray) -> dict[str, float]:
        """Return the share of each limit that a motion uses, by name; at most 1 where it is kept
        [1].

        The swing is that of a pendulum, linear about hanging, under the motion's acceleration.

        Args:
            t: (n,) equally spaced times [s].
            flat: (5, n, 3) position and its four derivatives in W.
        """
        force = flat[2] + [0.0, 0.0, self.vehicle.gravity]
        rotors = targets(self.vehicle, flat, np.zeros((len(t), 6)))[1] @ self.vehicle.unmixer.T
        swings = [
            np.abs(swing_of(p.length, self.vehicle.gravity, t, flat[2])).max()
            for p in self.payloads
        ]
        return {
            "room": self.room(flat[0]),
            "speed": float(np.linalg.norm(flat[1], axis=1).max()) / self.speed,
            "tilt": float(np.arctan2(np.linalg.norm(force[:, :2], axis=1), force[:, 2]).max())
            / self.tilt,
            "thrust": max(self.thrust(load * rotors) for load in self.load),
            **({"swing": float(max(swings)) / self.swing} if swings else {}),
        }

    def room(self, p: np.ndarray) -> float:
        """Return the largest distance of positions p (n, 3) from the middle over the room there is
        [1].
        """
        return float(np.max(np.abs(p - self.center) / self.half))

    def thrust(self, rotors: np.ndarray) -> float:
        """Return the share of the way from hover to the limits that rotor thrusts (n, 4) [N] go
        [1].
        """
        hover = 0.25 * self.vehicle.mass * self.vehicle.gravity
        up = (rotors.max() - hover) / (MOST_THRUST * self.vehicle.max_rotor_thrust - hover)
        return float(max(up, (hover - rotors.min()) / (hover * (1.0 - LEAST_THRUST))))


def limits_for(
    vehicle: Vehicle,
    explanations: Sequence[Explanation],
    *,
    box: Sequence[float],
    speed: float,
    tilt: float,
) -> Limits:
    """Return the limits of a flight in a room under any of the explanations.

    Args:
        explanations: that stand; the heaviest and the weakest set the thrust, payloads the floor.
        box: (3,) size of the room along x, y, z [m]; its floor lies at z = 0, in the middle of x
            and y.
        speed: largest speed [m/s].
        tilt: largest tilt [rad].
    Raises: ValueError: if speed or tilt are impossible, the room is too small, or the vehicle
        cannot carry its load.
    """
    if not (0 < speed < np.inf and 0 < tilt < 0.5 * np.pi):
        raise ValueError(
            f"limits: speed [m/s] must be positive, tilt below pi/2 [rad]; got {speed:g}, {tilt:g}."
        )
    hung = [split_effects(x.effects).payload for x in explanations]
    payloads = tuple(effect.payload for effect in hung if effect is not None)
    below = max((p.length - p.hook[2] + CLEAR for p in payloads), default=WALL)
    x, y, z = box
    lower = np.array([-0.5 * x + WALL, -0.5 * y + WALL, max(WALL, below)])
    upper = np.array([0.5 * x - WALL, 0.5 * y - WALL, z - WALL])
    if not np.all(upper - lower >= WALL):
        least = [3 * WALL, 3 * WALL, float(lower[2]) + 2 * WALL]
        raise ValueError(
            f"limits: box must be at least {' '.join(f'{v:.2g}' for v in least)} m; got "
            f"{' '.join(f'{v:g}' for v in box)}. Fly in a larger room."
        )
    loads = [1.0, *(load_of(vehicle, e) for e in explanations)]
    limits = Limits(vehicle, lower, upper, speed, tilt, (min(loads), max(loads)), payloads)
    hover = np.full((1, 4), 0.25 * vehicle.mass * vehicle.gravity)
    if limits.thrust(limits.load[1] * hover) > 0.5:
        raise ValueError("limits: the rotors must have thrust left in hover in every explanation.")
    return limits


def load_of(vehicle: Vehicle, explanation: Explanation) -> float:
    """Return the command that hover needs under an explanation over the nominal one [1]."""
    parts = split_effects(explanation.effects)
    mass = mass_properties(vehicle, parts.mass).mass + (
        parts.payload.mass if parts.payload else 0.0
    )
    thrust = np.full(4, 0.25 * vehicle.mass * vehicle.gravity)
    real = thrust
    for effect in parts.actuator:
        real = effect.thrust(vehicle, effect.state_at(vehicle, real), real, 0.0)
    return float(mass / vehicle.mass * thrust.mean() / real.mean())


def swing_of(length: float, gravity: float, t: np.ndarray, a: np.ndarray) -> np.ndarray:
    """Return the angles (n, 2) from vertical of a pendulum whose hook accelerates [rad]; linear,
    from rest.

    Args:
        length: of the tether [m].
        gravity: [m/s²].
        t: (n,) equally spaced times [s].
        a: (n, 3) acceleration of the hook in W [m/s²].
    """
    numerator, denominator = _pendulum(length, gravity, float(t[1] - t[0]))
    return signal.lfilter(numerator, denominator, -a[:, :2], axis=0)


@lru_cache
def _pendulum(length: float, gravity: float, step: float) -> tuple[np.ndarray, np.ndarray]:
    rate = np.sqrt(gravity / length)
    system = ([1.0 / length], [1.0, 2 * DAMPING * rate, rate**2])
    # Zero-order hold: exact for an acceleration that is held over each step.
    numerator, denominator, _ = signal.cont2discrete(system, step, method="zoh")
    return np.ravel(numerator), denominator
