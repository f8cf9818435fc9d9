"""Effects of simulated cases, drawn from invisible to strong and scaled to the vehicle
(`Effect.draw`).
"""

import numpy as np

from np_drake.effects.base import Effect
from np_drake.effects.library import LIBRARY
from np_drake.effects.linear_drag import LinearDrag
from np_drake.effects.parameter import drag_coefficients
from np_drake.vehicle import Vehicle


def draw_effect(
    name: str, rng: np.random.Generator, vehicle: Vehicle, seconds: float
) -> list[Effect]:
    """Return the effect `name` with random parameters, and the drag that it acts through where it
    needs one.

    Args:
        seconds: duration of the flights [s].
    """
    effect = LIBRARY[name].of(LIBRARY[name].draw(rng, vehicle, seconds))
    return (
        [effect, LinearDrag(*drag_coefficients(rng, vehicle, 0.05, 0.3))]
        if effect.needs
        else [effect]
    )
