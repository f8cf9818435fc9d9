"""Naive manoeuvres that a random multisine is compared with: sprints, climbs, a circle, shakes."""

import numpy as np

from np_drake.flight_design.limits import Limits
from np_drake.flight_design.multisine import SHARE, FadedMultisine, largest, random_multisine

MULTISINE = "multisine"
SLOW, FAST = (
    0.25,
    1.2,
)  # of manoeuvres that take the room, and of those that take tilt [Hz]; own choice
_LEVEL = np.array(
    [[0.0, 0.5 * np.pi, 0.0]]
)  # phase of y a quarter of a turn ahead of that of x [rad]
NAIVE = {  # name: axes that move, frequency
    "sprints": ((1.0, 0.0, 0.0), SLOW),
    "climbs": ((0.0, 0.0, 1.0), SLOW),
    "circle": ((1.0, 1.0, 0.0), SLOW),
    "shakes": ((1.0, 1.0, 0.0), FAST),
}


def manoeuvres(limits: Limits, seconds: float, *, seed: int) -> dict[str, FadedMultisine]:
    """Return by name a random multisine and the naive manoeuvres, each as large as the limits
    allow.

    Args:
        seconds: length of each flight [s].
    """
    found = {MULTISINE: random_multisine(limits, seconds, seed=seed)}
    for name, (axes, frequency) in NAIVE.items():
        amplitude = np.array([axes]) * limits.half
        if axes[0] and axes[1]:
            amplitude[0, :2] = limits.half[:2].min()
        tone = np.full((1, 3), frequency)
        found[name] = largest(
            FadedMultisine(limits.center, amplitude, tone, _LEVEL, seconds), limits, SHARE
        )
    return found
