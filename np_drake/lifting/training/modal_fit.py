"""Fit of E, A, B, C of one block to a compressed multi-step loss; A is stable by construction.

A is block diagonal: 2 x 2 rotations scaled by r, and real modes r, each r = r_max exp(-exp(a)) with a =
log(step / time constant). So |A| <= r_max < 1 whatever the parameters, slow modes are as easy to reach as
fast ones, and C A^i is written down for all horizons at once instead of being iterated.
"""

import dataclasses as dc
from collections.abc import Callable

import numpy as np
import torch
from scipy.optimize import minimize

from np_drake.lifting.training.delay_regression import DelayRegression

LEVEL_MEMORY = 200.0  # time constant of the levels [s]: they hold a payload's weight over any horizon
FADING = 2.0  # longest time constant of the other modes [horizons of the loss]
RIDGE = 1e-2  # weight of the modes' amplitudes: keeps modes from cancelling one another [1]


@dc.dataclass(frozen=True)
class BlockMatrices:
    """Encoder E (K, D (l + p)), A (K, K), B (K, p), C (m, K) of one block, scaled units."""

    E: np.ndarray
    A: np.ndarray
    B: np.ndarray
    C: np.ndarray


class ModalBlock:
    """Parameter vector theta = [a, angle H of pairs; a of reals; C; B] of one block and its loss.

    The last `outputs` modes are levels: real, almost integrators, not driven by zeta. All others die out within a few
    horizons of the loss, so that a forecast beyond what was trained fades into a constant.

    Args:
        regression: compressed loss.
        size: lifted states [1].
        pairs: pairs of them that oscillate [1].
        step: between samples [s].
    """

    def __init__(self, regression: DelayRegression, *, size: int, pairs: int, step: float):
        self.size, self.pairs, self.step = size, pairs, step
        self._regression = regression
        r = regression
        self._free_u, self._free_y = torch.from_numpy(r.free_u), torch.from_numpy(r.free_y)
        self._fixed_u, self._fixed_y = torch.from_numpy(r.fixed_u), torch.from_numpy(r.fixed_y)
        self._weights = torch.from_numpy(r.weights)
        H = int(r.horizons[-1])
        self.reals = size - 2 * pairs - r.outputs
        if self.reals < 0:
            raise ValueError(f"ModalBlock: size must be at least {2 * pairs + r.outputs}; got {size}.")
        self._log_radius = -1.0 / (FADING * H)
        self._level = -step / LEVEL_MEMORY
        self._steps = torch.arange(H, dtype=torch.float64)
        self._horizons = torch.from_numpy(r.horizons.astype(float))
        lag = r.horizons[:, None] - 1 - np.arange(H)  # zeta_j reaches chi_i through C A^(i-1-j) B
        self._lag = torch.from_numpy(np.where(lag < 0, H, lag))

    @property
    def whitener(self) -> np.ndarray:
        """Lower factor of the second moment of the encoder's windows, (D (l + p), D (l + p))."""
        return self._regression.whitener

    def initial_theta(self, generator: np.random.Generator) -> np.ndarray:
        """Return a start: modes on a grid over the horizon's time scales, C random, B small."""
        r = self._regression
        H = r.horizons[-1]
        frequency = np.minimum(0.2 / (H * self.step) * 2.2 ** np.arange(self.pairs), 0.2 / self.step)
        frequency *= np.exp(0.2 * generator.standard_normal(self.pairs))
        decay = 1.2 / np.maximum(frequency, 1.0 / (H * self.step))
        real = np.geomspace(H * self.step, 2 * self.step, self.reals)
        C = generator.standard_normal((r.outputs, self.size))
        B = 0.01 * generator.standard_normal((self.size - r.outputs, r.inputs))
        angle = 2 * np.pi * frequency * self.step * H
        parts = [np.log(self.step / decay), angle, np.log(self.step / real), C.ravel(), B.ravel()]
        return np.concatenate(parts)

    def loss(self, theta: torch.Tensor) -> torch.Tensor:
        """Return the mean squared ratio to persistence over horizons and outputs, at the best E [1]."""
        O, response, amplitudes = self._operators(theta)
        free = self._free_y - self._free_u @ response
        fixed = self._fixed_y - self._fixed_u @ response
        Q, _ = torch.linalg.qr(O)  # of the ridged problem: min |free - O z|² + ridge |amplitude of z|²
        projected = free @ Q[: free.shape[1]]
        rest = free.square().sum() - projected.square().sum()
        rest = rest + fixed.square().sum() + self._regression.floor + amplitudes
        return rest / self._regression.count

    def loss_and_gradient(self, theta: np.ndarray) -> tuple[float, np.ndarray]:
        """Return the loss and its gradient at theta."""
        variable = torch.tensor(theta, requires_grad=True)
        loss = self.loss(variable)
        loss.backward()
        assert variable.grad is not None
        return loss.item(), variable.grad.numpy()

    def matrices(self, theta: np.ndarray) -> BlockMatrices:
        """Return E, A, B, C at theta, with states scaled so that each mode's column of C has length one."""
        with torch.no_grad():
            variable = torch.tensor(theta)
            O, response, _ = self._operators(variable)
            free = (self._free_y - self._free_u @ response).T
            free = torch.cat([free, torch.zeros(self.size, free.shape[1], dtype=free.dtype)])
            initial = torch.linalg.lstsq(O, free, driver="gelsd").solution.numpy()
            parts = self._parts(variable)
            scale = self._column_length(parts[3]).numpy()
            a, angle, real, C, B = (part.numpy() for part in parts)
        # The initial state is z = E h, and whitened histories are L^-1 h: E = Z L^-1
        E = np.linalg.solve(self._regression.whitener.T, initial.T).T
        radius = np.exp(self._log_radius - np.exp(a))
        reals = np.exp(self._log_radius - np.exp(real))
        levels = np.full(self._regression.outputs, np.exp(self._level))
        A = np.diag(np.concatenate([np.zeros(2 * self.pairs), reals, levels]))
        for k, (r, phi) in enumerate(zip(radius, angle, strict=True)):
            A[2 * k : 2 * k + 2, 2 * k : 2 * k + 2] = r * np.array(
                [[np.cos(phi), -np.sin(phi)], [np.sin(phi), np.cos(phi)]]
            )
        return BlockMatrices(E * scale[:, None], A, B * scale[:, None], C / scale)

    def _column_length(self, C: torch.Tensor) -> torch.Tensor:
        """Return the length of each mode's columns of C, one value for a pair, (size,).

        It is the mode's output per unit of state.
        """
        square = C.square().sum(dim=0)
        pairs = square[: 2 * self.pairs].reshape(-1, 2).sum(dim=1).repeat_interleave(2)
        return torch.sqrt(torch.cat([pairs, square[2 * self.pairs :]]) + 1e-24)

    def _parts(self, theta: torch.Tensor) -> tuple[torch.Tensor, ...]:
        r = self._regression
        driven = self.size - r.outputs
        sizes = [self.pairs, self.pairs, self.reals, r.outputs * self.size, driven * r.inputs]
        a, angle, real, C, B = torch.split(theta, sizes)
        B = torch.cat([B.reshape(driven, -1), torch.zeros(r.outputs, r.inputs, dtype=B.dtype)])
        return a, angle / float(r.horizons[-1]), real, C.reshape(-1, self.size), B

    def _operators(self, theta: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
        """Return the operators of the loss.

        They are the weighted observability O over its ridge (ny + K, K), the weighted response to the coming inputs
        (nu, ny), and the ridge on that response (a number).
        """
        a, angle, real, C, B = self._parts(theta)
        r = self._regression
        O = self._output_powers(a, angle, real, C, self._horizons) * self._weights[:, None, None]
        markov = self._output_powers(a, angle, real, C, self._steps) @ B
        markov = torch.cat([markov, torch.zeros(1, r.outputs, r.inputs, dtype=markov.dtype)])
        response = markov[self._lag] * self._weights[:, None, None, None]
        nu = len(self._steps) * r.inputs
        length = self._column_length(C)
        ridged = torch.cat([O.reshape(-1, self.size), np.sqrt(RIDGE) * torch.diag(length)])
        amplitudes = RIDGE * (length[:, None] * B).square().sum()
        return ridged, response.permute(1, 3, 0, 2).reshape(nu, -1), amplitudes

    def _output_powers(self, a, angle, real, C, powers) -> torch.Tensor:
        """Return C A^i, (len(powers), m, K)."""
        i = powers[:, None]
        radius = torch.exp(i * (self._log_radius - torch.exp(a)))
        cosine = (radius * torch.cos(i * angle))[:, None]
        sine = (radius * torch.sin(i * angle))[:, None]
        pairs = C[:, : 2 * self.pairs].reshape(-1, self.pairs, 2)
        C1, C2 = pairs[..., 0], pairs[..., 1]
        rotated = torch.stack([C1 * cosine + C2 * sine, C2 * cosine - C1 * sine], dim=-1).flatten(-2)
        levels = torch.full((self._regression.outputs,), self._level, dtype=C.dtype)
        logs = torch.cat([self._log_radius - torch.exp(real), levels])
        decayed = C[:, 2 * self.pairs :] * torch.exp(i * logs)[:, None]
        return torch.cat([rotated, decayed], dim=-1)


def descend(
    block: ModalBlock, theta: np.ndarray, *, iterations: int, on_iteration: Callable[[float], None] = lambda _: None
) -> tuple[np.ndarray, list[float]]:
    """Minimise the loss of `block` by L-BFGS from theta and return (theta, loss after each iteration).

    It is deterministic.

    Args:
        block: whose loss it is.
        theta: parameters at the start.
        iterations: at most.
        on_iteration: called with the loss.
    """
    history: list[float] = []

    def record(intermediate_result) -> None:
        history.append(float(intermediate_result.fun))
        on_iteration(history[-1])

    if iterations < 1:
        return theta, history
    options = {"maxiter": iterations, "maxcor": 30, "ftol": 1e-7, "gtol": 1e-8}
    result = minimize(block.loss_and_gradient, theta, jac=True, method="L-BFGS-B", callback=record, options=options)
    return result.x, history
