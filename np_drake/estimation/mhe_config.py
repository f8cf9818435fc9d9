"""Weights of the moving-horizon estimator."""

import dataclasses as dc

import numpy as np

CHANNELS = 6  # x, y, z of the velocity, x, y, z of the body rates


@dc.dataclass
class MheConfig:
    """Horizon and fixed weights; six entries are [x, y, z of velocity, x, y, z of body rates].

    At the newest sample the cost weighs a residual y_k - Y_k with `measurement` and a noise w_k with `process`;
    each step back multiplies them with the forgetting factors. Only ratios within a channel matter.
    Default weights: own choice, 1 mm/s and 3 mrad/s of noise, and a wrench that changes by 100 m/s² and
    1000 rad/s² in a second. `mhe_tuning.tune` finds better ones.
    """

    horizon: int = 10  # N: steps, so N + 1 samples [1]. Source: Wang et al. 2024, section VII-A
    arrival_motion: list[float] = dc.field(default_factory=lambda: [1e6] * 3 + [1e5] * 3)  # [s²/m², s²/rad²]
    arrival_acceleration: list[float] = dc.field(default_factory=lambda: [10.0] * 3 + [0.1] * 3)  # [s⁴/m² …]
    measurement: list[float] = dc.field(default_factory=lambda: [1e6] * 3 + [1e5] * 3)  # [s²/m², s²/rad²]
    process: list[float] = dc.field(default_factory=lambda: [1e-4] * 3 + [1e-6] * 3)  # [s⁶/m², s⁶/rad²]
    forgetting_measurement: float = 1.0  # gamma_1 in (0, 1] [1]
    forgetting_process: float = 1.0  # gamma_2 in (0, 1] [1]

    def check(self) -> "MheConfig":
        """Return self after checking horizon, weights and factors.

        Raises: ValueError: if one is impossible.
        """
        if not self.horizon >= 1:
            raise ValueError(f"MheConfig: horizon must be at least 1; got {self.horizon}.")
        for name in ("arrival_motion", "arrival_acceleration", "measurement", "process"):
            weight = np.array(getattr(self, name), float)
            if weight.shape != (CHANNELS,) or not np.all((weight > 0) & (weight < np.inf)):
                raise ValueError(
                    f"MheConfig: {name} must have {CHANNELS} positive entries; got {weight.tolist()}."
                )
        for name in ("forgetting_measurement", "forgetting_process"):
            if not 0 < getattr(self, name) <= 1:
                raise ValueError(f"MheConfig: {name} must lie in (0, 1]; got {getattr(self, name)}.")
        return self
