"""Solution of one window in closed form: a linear map of the arrival estimate and the samples.

Without the known input, each channel of the model is y+ = y + h d + h²/2 w, d+ = d + h w, so that the window's
cost is a least-squares problem in [y_0, d_0, h w_0 … h w_(n-1)] for each of the six channels alone.
"""

import dataclasses as dc

import torch

from np_drake.estimation.mhe_config import MheConfig


@dc.dataclass(frozen=True)
class MheWeights:
    """Weights as tensors (6,) and forgetting factors (), with respect to which `tune` differentiates."""

    arrival: torch.Tensor  # (6, 2): of y_0 and of d_0
    measurement: torch.Tensor  # (6,) of y
    process: torch.Tensor  # (6,) of w
    forgetting_measurement: torch.Tensor  # () gamma_1 [1]
    forgetting_process: torch.Tensor  # () gamma_2 [1]

    @staticmethod
    def of(config: MheConfig) -> "MheWeights":
        """Return the weights of a configuration, in double precision."""
        arrival = torch.tensor([config.arrival_motion, config.arrival_acceleration], dtype=torch.float64).T
        rest = (config.measurement, config.process, config.forgetting_measurement, config.forgetting_process)
        return MheWeights(arrival, *(torch.tensor(value, dtype=torch.float64) for value in rest))


def window_gains(
    weights: MheWeights, step: float, n: int, seen: torch.Tensor | None = None
) -> tuple[torch.Tensor, torch.Tensor]:
    """Return the gains of a window of n steps, without known input.

    Args:
        step: [s].   seen: (n + 1, 6) 1 where a sample counts, 0 where it is missing; default: all count.
    Returns:
        (6, 2 (n + 1), 2) from the arrival estimate [y, d] and (6, 2 (n + 1), n + 1) from the samples to the
        trajectory [y_0 … y_n, d_0 … d_n].
    """
    to_y, to_d = _maps(step, n)
    age = torch.arange(n, -1, -1, dtype=torch.float64)
    R = weights.measurement[:, None] * weights.forgetting_measurement**age
    if seen is not None:
        R = R * seen.T
    Q = weights.process[:, None] / step**2 * weights.forgetting_process ** age[1:]
    weighted = to_y.T * R[:, None, :]  # (6, 2 + n, n + 1)
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
