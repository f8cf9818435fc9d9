"""Moving air for the simulator `rotorpy`, with the interface of rotorpy's wind profiles."""

from collections.abc import Sequence

import numpy as np
from rotorpy.wind.default_winds import ConstantWind as RotorPyConstantWind

from diagrams.challenge.simulators.coloured_noise import gauss_markov
from np_drake.effects.base import WrenchEffect
from np_drake.effects.constant_wind import ConstantWind
from np_drake.effects.gusty_wind import GustyWind

FIRST, LAST, STEP = -8.0, 320.0, 0.005  # when gusts are blown, and how densely they are drawn [s]


class Gusts:
    """A mean wind and a Gauss-Markov process on every axis, drawn at `STEP` and straight between.

    Not Dryden, whose deviation and correlation time depend on height and speed.
    """

    def __init__(self, wind: GustyWind):
        t = np.arange(FIRST, LAST, STEP)
        rng = np.random.default_rng([wind.seed, 2])
        gusts = gauss_markov(rng, t, 3, rms=wind.deviation, tau=wind.correlation_time)
        self._path = gusts + [wind.mean_x, wind.mean_y, wind.mean_z]

    def update(self, t: float, position: np.ndarray) -> np.ndarray:
        """Return the velocity of the air (3,) in W [m/s], the same everywhere.

        Args:
            t: [s].
            position: (3,) in W [m].
        """
        row = min(max((t - FIRST) / STEP, 0.0), len(self._path) - 1.001)
        k = int(row)
        return self._path[k] + (row - k) * (self._path[k + 1] - self._path[k])


class _AirOf:
    """The air as another effect moves it."""

    def __init__(self, effect: WrenchEffect):
        self._effect = effect

    def update(self, t: float, position: np.ndarray) -> np.ndarray:
        return self._effect.air_velocity(t)


def winds(effects: Sequence[WrenchEffect]) -> list:
    """Return the wind profiles among the effects."""
    out: list = []
    for effect in effects:
        if isinstance(effect, GustyWind):
            out.append(Gusts(effect))
        elif isinstance(effect, ConstantWind):
            out.append(RotorPyConstantWind(effect.x, effect.y, effect.z))
        elif type(effect).air_velocity is not WrenchEffect.air_velocity:
            out.append(_AirOf(effect))
    return out
