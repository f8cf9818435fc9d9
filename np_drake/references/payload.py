"""Motion of the vehicle under which a payload on a cable follows a track, and of a formation that
carries one.
"""

from collections.abc import Sequence

import numpy as np

from np_drake import attitude
from np_drake.references.base import Reference
from np_drake.references.flatness import targets
from np_drake.vehicle import Vehicle

STEP = (
    0.01  # between the instants of a difference [s]; own choice: far below the period of any swing
)
# Central differences of seven points: the function and its four derivatives, exact for polynomials
# of degree 6.
_POWERS = np.arange(-3.0, 4.0)
_DIFFERENCES = (
    np.linalg.inv(np.vander(_POWERS, increasing=True))[:5]
    * np.array([1.0, 1.0, 2.0, 6.0, 24.0])[:, None]
)


class PayloadTrack:
    """Motion of Bo under which the payload follows `track`.

    The pull of the cable is all that accelerates the payload: it lies along a_P + g z, and the hook
    stands one cable length up that direction. The vehicle's own attitude differs from that
    direction by little, and moves Bo by less than a twentieth of the hook's lever: it is taken as
    the same. Source: differential flatness of a quadrotor with a suspended payload (Sreenath et
    al., 2013), without mass of the cable and drag; own choice: derivatives by differences, since
    the snap of Bo takes the sixth derivative of the track.

    Args:
        length: of the cable [m].
        hook: p_BoTo_B (3,) [m].
    """

    def __init__(self, track: Reference, vehicle: Vehicle, *, length: float, hook: Sequence[float]):
        self.track, self._vehicle = track, vehicle
        self._p_PBo = np.array([0.0, 0.0, length]) - hook
        self.rate = getattr(track, "rate", None)

    def sample(self, t: np.ndarray) -> np.ndarray:
        """Return p and its four derivatives of Bo in W, (5, n, 3), at times t (n,) [s]."""
        t = np.asarray(t, float)
        flat = self.track.sample((t[:, None] + STEP * _POWERS).ravel())
        x, _ = targets(self._vehicle, flat, np.zeros((flat.shape[1], 6)))
        p = flat[0] + attitude.rotate(x[:, 3:7], np.broadcast_to(self._p_PBo, flat[0].shape))
        p = p.reshape(len(t), len(_POWERS), 3)
        return np.einsum("kj,njc->knc", _DIFFERENCES, p) / (STEP ** np.arange(5.0))[:, None, None]

    def least_pull(self, t: np.ndarray) -> float:
        """Return the least pull of the cable at times t (n,) over the payload's weight [1]."""
        pull = self.track.sample(t)[2] + [0.0, 0.0, self._vehicle.gravity]
        return float(np.linalg.norm(pull, axis=1).min() / self._vehicle.gravity)


def polygon(count: int, spacing: float) -> np.ndarray:
    """Return the corners of a level regular polygon about the origin, (count, 3) [m].

    Two corners lie on the x axis, as does the first of more; a single one lies at the origin.

    Args:
        count: of corners [1].
        spacing: between neighbours [m].
    """
    radius = 0.0 if count == 1 else spacing / (2 * np.sin(np.pi / count))
    angle = 2 * np.pi * np.arange(count) / count
    return radius * np.stack([np.cos(angle), np.sin(angle), np.zeros(count)], axis=1)


def payload_drop(radius: float, length: float, hook_z: float) -> float:
    """Return the height of the payload over the vehicles, a negative number [m].

    The cables are taut, and the vehicles are level on a circle of `radius` [m].

    Args:
        radius: of the circle [m].
        length: of a cable, its stretch included [m].
        hook_z: height of the hook over Bo [m].
    Raises: ValueError: if the cables do not reach the middle.
    """
    if not radius < length:
        raise ValueError(
            f"formation: its radius must be below the cable's length; got {radius}, {length} [m]."
        )
    return float(hook_z - np.sqrt(length**2 - radius**2))


def closest_approach(p: np.ndarray) -> float:
    """Return the smallest distance of any two of positions p (n, rows, 3) at any time [m]; inf for
    one vehicle.
    """
    pairs = [(i, j) for i in range(len(p)) for j in range(i)]
    return min(
        (float(np.linalg.norm(p[i] - p[j], axis=-1).min()) for i, j in pairs), default=np.inf
    )
