"""A flight plan: where to fly and which way to look, as targets of a controller."""

import dataclasses as dc

import numpy as np

from diagrams.batch.failed_run import FailedRun
from np_drake import attitude
from np_drake.references.base import Paced, Reference
from np_drake.vehicle import Vehicle

_DELTA = 2e-3  # of the central differences from attitude to rate and angular acceleration [s]
ROTOR_SHARE = (
    0.08,
    0.62,
)  # of the largest thrust that a plan may ask of a rotor: the rest is for surprises
FASTEST = 8.0  # [m/s]
STEEPEST = 0.75  # tilt [rad]
# A vehicle counts as lost farther from the plan [m], lower [m], or with a smaller cosine of its
# tilt [1].
FARTHEST, LOWEST, LEAST_UPRIGHT = 6.0, 0.03, -0.2


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
        return (
            self.start
            + self.rate * turned
            + 0.5 * self.swing * (1 - np.cos(2 * np.pi * self.frequency * after))
        )


@dc.dataclass(frozen=True)
class Plan:
    """One flight as planned."""

    kind: str
    reference: Reference
    heading: Heading = dc.field(default_factory=Heading)

    def start(self, gravity: float) -> np.ndarray:
        """Return position and attitude (7,) at rest, before and at t = 0."""
        zero = np.zeros(1)
        return np.concatenate([self.reference.sample(zero)[0, 0], self._attitude(gravity, zero)[0]])

    def targets(self, gravity: float, t: np.ndarray) -> np.ndarray:
        """Return the targets (n, 16) of `np_drake.control.cascade`.

        Args:
            gravity: [m/s²].
            t: (n,) times [s].
        """
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
        sooner, later = self._attitude(gravity, t - _DELTA), self._attitude(gravity, t + _DELTA)
        turn = attitude.multiply(attitude.conjugate(sooner), later)
        return turn[:, 1:] * np.sign(turn[:, :1]) / _DELTA

    def rotor_thrust(self, vehicle: Vehicle, t: np.ndarray) -> np.ndarray:
        """Return the rotor thrusts (n, 4) that the plan asks of a nominal vehicle [N].

        Args:
            t: (n,) times [s].
        """
        target = self.targets(vehicle.gravity, t)
        a, w, al = target[:, 6:9], target[:, 9:12], target[:, 12:15]
        f = vehicle.mass * np.linalg.norm(a + [0.0, 0.0, vehicle.gravity], axis=1, keepdims=True)
        tau = al @ vehicle.J.T + np.cross(w, w @ vehicle.J.T)
        return np.concatenate([f, tau], axis=1) @ vehicle.unmixer.T


def require_flying(x: np.ndarray, target: np.ndarray, t: float) -> None:
    """Raise FailedRun where a vehicle is lost: far off, low or upside down.

    Args:
        x: (13,) its state.
        target: (16,) of the controller.
        t: time [s].
    """
    upright = 1 - 2 * (x[4] ** 2 + x[5] ** 2)
    if not (
        np.linalg.norm(x[:3] - target[:3]) < FARTHEST and x[2] > LOWEST and upright > LEAST_UPRIGHT
    ):
        raise FailedRun(f"challenge: the vehicle was lost at {t:.2f} s.")


def within_limits(plan: Plan, vehicle: Vehicle, seconds: float) -> Plan:
    """Return the plan, slowed down until a nominal vehicle can fly it.

    Args:
        seconds: length of the flight [s].
    Raises: ValueError: if no pace is slow enough.
    """
    t = np.arange(0.0, seconds, 0.02)
    low, high = np.array(ROTOR_SHARE) * vehicle.max_rotor_thrust
    for factor in 0.9 ** np.arange(25):
        slow = dc.replace(plan, reference=Paced(plan.reference, float(factor)))
        thrust, (v, a) = slow.rotor_thrust(vehicle, t), slow.reference.sample(t)[1:3]
        gentle = np.all(
            np.linalg.norm(a[:, :2], axis=1) <= np.tan(STEEPEST) * (a[:, 2] + vehicle.gravity)
        )
        slow_enough = np.linalg.norm(v, axis=1).max() <= FASTEST
        if gentle and slow_enough and low <= thrust.min() and thrust.max() <= high:
            return slow
    raise ValueError(
        f"within_limits: {vehicle.name} must be able to fly the plan {plan.kind!r} at some pace."
    )
