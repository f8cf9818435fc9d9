"""Effect `gusty_wind`: a gusty wind, which acts through a drag."""

import dataclasses as dc

import numpy as np

from np_drake.effects.base import Parameter, WrenchEffect, direction, log_uniform
from np_drake.effects.disturbance import along
from np_drake.vehicle import Vehicle


@dc.dataclass(frozen=True)
class GustyWind(WrenchEffect):
    """Wind mean + gust(t) in W; every axis of the gust is a first-order Gauss-Markov process.

    Spectrum 2 deviation² T / (1 + w² T²), T = correlation_time; a sum of sinusoids with phases by
    `seed`, so that the wind can be evaluated at any t.
    Source: own choice: Ornstein-Uhlenbeck, not Dryden.
    """

    mean_x: float = 2.0  # [m/s]
    mean_y: float = 0.0  # [m/s]
    mean_z: float = 0.0  # [m/s]
    deviation: float = 1.0  # of each axis [m/s]
    correlation_time: float = 1.0  # [s]
    seed: int = 0  # of the phases

    requires = ("velocity",)
    named = "a gusty wind"
    phrase = "a gusty wind of {deviation} deviation"
    bench_check = "measure the wind, or fly indoors"
    excited_by = "hover for a minute, then fly the same place again"
    needs = ("linear_drag", "quadratic_drag")
    linear = False
    parameters = (
        *(Parameter(f"mean_{axis}", "m/s", 0.0, -15.0, 15.0, 2.0) for axis in "xyz"),
        Parameter("deviation", "m/s", 0.0, 0.0, 8.0, 1.0),
        Parameter("correlation_time", "s", 1.0, 0.05, 20.0, 1.0, vanishes=False),
    )

    @classmethod
    def draw(cls, rng: np.random.Generator, vehicle: Vehicle, seconds: float) -> dict[str, float]:
        """Return random parameters of a simulated case."""
        strength = log_uniform(rng, 0.3, 3.0)
        mean = strength * rng.uniform(0.3, 2.0) * direction(rng, 0.1)
        return {
            **dict(zip(("mean_x", "mean_y", "mean_z"), mean, strict=True)),
            "deviation": strength,
            "correlation_time": log_uniform(rng, 0.4, 3.0),
        }

    @property
    def predicted(self) -> "GustyWind":
        """Steady wind of the mean, since gusts do not repeat."""
        return dc.replace(self, deviation=0.0)

    def air_velocity(self, t: np.ndarray | float) -> np.ndarray:
        """Return the wind in W, (..., 3) [m/s]."""
        size = np.full(3, self.deviation)
        time = np.full(3, self.correlation_time)
        return np.array([self.mean_x, self.mean_y, self.mean_z]) + along(t, size, time, self.seed)
