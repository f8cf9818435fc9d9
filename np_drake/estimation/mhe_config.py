"""Weights of the moving-horizon estimator."""

import dataclasses as dc

import numpy as np
import torch

CHANNELS = 6  # x, y, z of the velocity, x, y, z of the body rates


@dc.dataclass
class MheConfig:
    """Horizon and fixed weights; six entries are [x, y, z of velocity, x, y, z of body rates].

    At the newest sample the cost weighs a residual y_k - Y_k with `measurement` and a noise w_k
    with `process`; each step back multiplies them with the forgetting factors. Only ratios within a
    channel matter. Default weights: own choice, 1 mm/s and 3 mrad/s of noise, and a wrench that
    changes by 100 m/s² and 1000 rad/s² in a second. `mhe_tuning.tune` finds better ones.
    """

    horizon: int = 10  # N: steps, so N + 1 samples [1]. Source: Wang et al. 2024, section VII-A
    arrival_motion: list[float] = dc.field(
        default_factory=lambda: [1e6] * 3 + [1e5] * 3
    )  # [s²/m², s²/rad²]
    arrival_acceleration: list[float] = dc.field(
        default_factory=lambda: [10.0] * 3 + [0.1] * 3
    )  # [s⁴/m² …]
    measurement: list[float] = dc.field(
        default_factory=lambda: [1e6] * 3 + [1e5] * 3
    )  # [s²/m², s²/rad²]
    process: list[float] = dc.field(
        default_factory=lambda: [1e-4] * 3 + [1e-6] * 3
    )  # [s⁶/m², s⁶/rad²]
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
                    f"MheConfig: {name} must have {CHANNELS} positive entries; got "
                    f"{weight.tolist()}."
                )
        for name in ("forgetting_measurement", "forgetting_process"):
            if not 0 < getattr(self, name) <= 1:
                raise ValueError(
                    f"MheConfig: {name} must lie in (0, 1]; got {getattr(self, name)}."
                )
        return self


@dc.dataclass(frozen=True)
class MheWeights:
    """Weights as tensors (6,) and forgetting factors (), with respect to which `tune`
    differentiates.
    """

    arrival: torch.Tensor  # (6, 2): of y_0 and of d_0
    measurement: torch.Tensor  # (6,) of y
    process: torch.Tensor  # (6,) of w
    forgetting_measurement: torch.Tensor  # () gamma_1 [1]
    forgetting_process: torch.Tensor  # () gamma_2 [1]

    @staticmethod
    def of(config: MheConfig) -> "MheWeights":
        """Return the weights of a configuration, in double precision."""
        arrival = torch.tensor(
            [config.arrival_motion, config.arrival_acceleration], dtype=torch.float64
        ).T
        rest = (
            config.measurement,
            config.process,
            config.forgetting_measurement,
            config.forgetting_process,
        )
        return MheWeights(arrival, *(torch.tensor(value, dtype=torch.float64) for value in rest))


def window_gains(
    weights: MheWeights, step: float, n: int, seen: torch.Tensor | None = None
) -> tuple[torch.Tensor, torch.Tensor]:
    """Return the gains of a window of n steps, without known input.

    Args:
        step: between samples [s].
        seen: (n + 1, 6) 1 where a sample counts, 0 where it is missing; default: all count.
    Returns:
        (6, 2 (n + 1), 2) from the arrival estimate [y, d] and (6, 2 (n + 1), n + 1) from the
        samples to the trajectory [y_0 … y_n, d_0 … d_n].
    """
    to_y, to_d = _maps(step, n)
    age = torch.arange(n, -1, -1, dtype=torch.float64)
    R = weights.measurement[:, None] * weights.forgetting_measurement**age
    if seen is not None:
        R = R * seen.T
    Q = weights.process[:, None] / step**2 * weights.forgetting_process ** age[1:]
    weighted = to_y.T * R[:, None, :]  # (6, 2 + n, n + 1)
    # Normal equations of the weighted least squares, channel by channel; the solution is linear in
    # arrival and samples.
    hessian = torch.diag_embed(torch.cat([weights.arrival, Q], dim=1)) + weighted @ to_y
    prior = torch.diag_embed(weights.arrival, dim1=-2, dim2=-1)
    prior = torch.cat([prior, prior.new_zeros(prior.shape[0], n, 2)], dim=1)
    solution = torch.linalg.solve(hessian, torch.cat([prior, weighted], dim=2))
    gains = torch.cat([to_y, to_d]) @ solution
    return gains[..., :2], gains[..., 2:]


def _maps(step: float, n: int) -> tuple[torch.Tensor, torch.Tensor]:
    """Return the maps from the unknowns to y_k, and to d_k, (n + 1, 2 + n) each."""
    k = torch.arange(n + 1, dtype=torch.float64)[:, None]
    steps = (k - k[:-1].T).clamp(min=0.0)  # whole steps since noise j began to act
    to_y = torch.cat([torch.ones_like(k), step * k, step * (steps - 0.5).clamp(min=0.0)], dim=1)
    to_d = torch.cat([torch.zeros_like(k), torch.ones_like(k), (steps > 0).double()], dim=1)
    return to_y, to_d
