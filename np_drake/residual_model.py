"""Interface of every residual model.

A residual model keeps its memory in a dictionary of arrays that the caller owns (a LeafSystem's
Context, or a benchmark's loop), takes one sample every `step` seconds, and answers with a
`WrenchForecast` over a horizon.
"""

import dataclasses as dc
from typing import Protocol, runtime_checkable

import numpy as np

from np_drake.compiled import compiled

Memory = dict[str, np.ndarray]
FORCE = np.repeat([1.0, 0.0], 3)  # of a wrench


@dc.dataclass(frozen=True)
class Sample:
    """Measurement, command and label of one sampling instant."""

    x: np.ndarray  # (13,) measured state
    u: np.ndarray  # (4,) command that acted up to now [N, N·m]
    chi: np.ndarray  # (6,) wrench label [N, N·m]; NaN where there is none


@dc.dataclass(frozen=True)
class Plan:
    """Motion that is intended from now on, at the step of the forecast."""

    x: np.ndarray  # (N+1, 13) states
    u: np.ndarray  # (N, 4) commands [N, N·m]


class Reaction(Protocol):
    """Wrench as a function g of the motion at the same instant: vectorised, differentiable, without
    memory.
    """

    def __call__(self, zeta: np.ndarray) -> np.ndarray:
        """Return chi (..., 6) [N, N·m] at zeta (..., 6) [m/s, rad/s]."""

    def jacobian(self, zeta: np.ndarray) -> np.ndarray:
        """Return dchi/dzeta (n, 6, 6) at zeta (n, 6)."""


@dc.dataclass(frozen=True)
class ForceAlone:
    """The force of a reaction, without its torque."""

    reaction: Reaction

    def __call__(self, zeta: np.ndarray) -> np.ndarray:
        """Return chi (..., 6) [N, N·m] at zeta (..., 6) [m/s, rad/s]."""
        return self.reaction(zeta) * FORCE

    def jacobian(self, zeta: np.ndarray) -> np.ndarray:
        """Return dchi/dzeta (n, 6, 6) at zeta (n, 6)."""
        return self.reaction.jacobian(zeta) * FORCE[:, None]


@dc.dataclass(frozen=True)
class WrenchForecast:
    """Forecast of the residual wrench over a horizon at its own step.

        chi_i = C z_i + offset_i + g(zeta_i),  z_(i+1) = A z_i + B zeta_i,  i = 0 … N-1

    chi_i acts from t_(k+i) to t_(k+i+1); zeta_i is the predicted [v_WB, w_WB_B] at t_(k+i). A model
    without feedback from the motion has K = 0 and uses `offset` alone.

    zeta: (6,) measured now; used by g alone [m/s, rad/s].
    start: (13,) state at t_k where that lies ahead, as commands are on their way until then; None:
        t_k is now.
    """

    A: np.ndarray  # (K, K)
    B: np.ndarray  # (K, 6) per [m/s, rad/s]
    C: np.ndarray  # (6, K)
    z: np.ndarray  # (K,) lifted state now
    offset: np.ndarray  # (N, 6) [N, N·m]
    reaction: Reaction | None = None  # g, None for zero
    zeta: np.ndarray = dc.field(default_factory=lambda: np.zeros(6))
    start: np.ndarray | None = None

    @property
    def first(self) -> np.ndarray:
        """First wrench of the forecast, chi_0 (6,) [N, N·m]."""
        chi = self.C @ self.z + self.offset[0]
        return chi if self.reaction is None else chi + self.reaction(self.zeta)

    def force_alone(self) -> "WrenchForecast":
        """Return the forecast without torque."""
        reaction = None if self.reaction is None else ForceAlone(self.reaction)
        C = self.C * FORCE[:, None]
        offset = self.offset * FORCE
        return dc.replace(self, C=C, offset=offset, reaction=reaction)

    def rollout(self, zeta: np.ndarray) -> np.ndarray:
        """Return chi_hat (N, 6) [N, N·m] for a given zeta (N, 6) [m/s, rad/s]."""
        chi = np.array(self.offset, float)
        if len(self.z):
            z = np.empty((len(chi), len(self.z)))
            z[0] = self.z
            z[1:] = zeta[:-1] @ self.B.T
            _advance(np.ascontiguousarray(self.A, float), z)
            chi += z @ self.C.T
        return chi if self.reaction is None else chi + self.reaction(zeta)


@compiled
def _advance(A, z):
    """Add A z_(i-1) to every row z_i (n, K) after the first, one after the other."""
    for i in range(1, len(z)):
        for row in range(len(A)):
            total = 0.0
            for s in range(len(A)):
                total += A[row, s] * z[i - 1, s]
            z[i, row] += total


@runtime_checkable
class ReadsPlan(Protocol):
    """A residual model that forecasts the wrench along an intended motion."""

    def forecast_along(
        self, memory: Memory, plan: Plan, *, horizon: int, stride: int
    ) -> WrenchForecast:
        """Return the forecast that is best where a plan is flown.

        Args:
            memory: with the sample of now.
            plan: at the steps of the forecast.
            horizon: N [1].
            stride: model steps in one step of the forecast [1].
        """


class ResidualModel(Protocol):
    """Predictor of the residual wrench chi, with methods that are pure functions of the memory."""

    @property
    def name(self) -> str:
        """Name of its row in a table."""

    @property
    def step(self) -> float:
        """Time between samples [s]."""

    def initial_memory(self) -> Memory:
        """Return arrays (float) of fixed shape, before any sample."""

    def update(self, memory: Memory, sample: Sample) -> Memory:
        """Return the memory after one more sample.

        A sample with NaN must leave a usable memory.

        Args:
            memory: before the sample; it stays as it is.
            sample: of now.
        """

    def forecast(self, memory: Memory, *, horizon: int, stride: int) -> WrenchForecast:
        """Return the forecast over the horizon.

        Args:
            memory: with the sample of now.
            horizon: N [1].
            stride: model steps in one step of the forecast [1].
        """


def constant_forecast(chi: np.ndarray, horizon: int) -> WrenchForecast:
    """Return a forecast that holds one wrench over the horizon, or follows a given trajectory.

    Args:
        chi: (6,) or (horizon, 6) [N, N·m].
        horizon: N [1].
    """
    offset = np.broadcast_to(np.asarray(chi, float), (horizon, 6))
    return WrenchForecast(np.zeros((0, 0)), np.zeros((0, 6)), np.zeros((6, 0)), np.zeros(0), offset)
