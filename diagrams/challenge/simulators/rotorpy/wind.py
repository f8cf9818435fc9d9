"""Moving air for the simulator `rotorpy`, with the interface of rotorpy's wind profiles."""

import numpy as np
from rotorpy.wind.default_winds import ConstantWind

from diagrams.challenge.simulators.coloured_noise import gauss_markov
from diagrams.challenge.simulators.rotorpy.library_effects import ActiveEffect

FIRST, LAST, STEP = -8.0, 320.0, 0.005  # when gusts are blown, and how densely they are drawn [s]


class Gusts:
    """A mean wind and a Gauss-Markov process on every axis, drawn at `STEP` and straight between.

    Not Dryden, whose deviation and correlation time depend on height and speed.
    """

    def __init__(self, acting: ActiveEffect):
        c = acting.values
        t = np.arange(FIRST, LAST, STEP)
        rng = np.random.default_rng([acting.seed, 2])
        gusts = gauss_markov(rng, t, 3, rms=c["deviation"], tau=c["correlation_time"])
        self._path = gusts + [c["mean_x"], c["mean_y"], c["mean_z"]]

    def update(self, t: float, position: np.ndarray) -> np.ndarray:
        """Return the velocity of the air (3,) in W [m/s], the same everywhere."""
        row = min(max((t - FIRST) / STEP, 0.0), len(self._path) - 1.001)
        k = int(row)
        return self._path[k] + (row - k) * (self._path[k + 1] - self._path[k])


def winds(acting: list[ActiveEffect]) -> list:
    """Return the wind profiles among the effects."""
    out: list = [Gusts(a) for a in acting if a.name == "gusty_wind"]
    for a in acting:
        if a.name == "constant_wind":
            out.append(ConstantWind(a.values["x"], a.values["y"], a.values["z"]))
    return out
