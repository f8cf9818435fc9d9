"""Data of one NP-MPC problem: configuration, horizon data, solution and status."""

import dataclasses as dc
from enum import IntEnum
from typing import Protocol

import numpy as np

from np_drake.residual_model import WrenchForecast

LONGEST_HORIZON = 200  # [1]; own choice: ten times the usual one, and 100 MB of matrices
COMMANDS = ("rotors", "rates")  # what an MPC may decide on
LONGEST_STEP = 10.0  # [s]; own choice
_WEIGHTS = {  # entries of each
    "weight_position": 3,
    "weight_attitude": 4,
    "weight_velocity": 3,
    "weight_rate": 3,
    "weight_rates": 3,
    "weight_input": 4,
}
_POSITIVE = {  # each with the reason, where it is not plain
    "weight_input": "",
    "weight_rates": "",
    "weight_position": ": the terminal set needs it",
}


@dc.dataclass
class MpcConfig:
    """Weights and sets of problem (nmpc).

    The error e_x is x - x* in the 13 state components.
    Source of the weights: tuned on the vehicle without payload, then frozen (`np-drake reproduce
    weights`).
    """

    horizon: int = 20  # N [1]
    step: float = 0.04  # [s]
    weight_position: list[float] = dc.field(default_factory=lambda: [160.0, 160.0, 320.0])  # [1/m²]
    weight_attitude: list[float] = dc.field(
        default_factory=lambda: [1.0, 5.0, 5.0, 5.0]
    )  # per q component
    weight_velocity: list[float] = dc.field(default_factory=lambda: [2.0, 2.0, 2.0])  # [s²/m²]
    weight_rate: list[float] = dc.field(default_factory=lambda: [0.03, 0.03, 0.03])  # [s²/rad²]
    weight_input: list[float] = dc.field(
        default_factory=lambda: [0.02, 18.0, 18.0, 45.0]
    )  # [1/N², 1/(N·m)²]
    # rotors: thrust and torque | rates: body rates and collective thrust, for an autopilot
    command: str = "rotors"
    weight_rates: list[float] = dc.field(
        default_factory=lambda: [0.3, 0.3, 0.3]
    )  # of commanded rates [s²/rad²]
    weight_swing: float = (
        0.0  # on the predicted lateral force, to damp a payload's swing; 0: off [1/N²]
    )
    terminal: str = "riccati"  # P: riccati = cost-to-go at hover | scaled = terminal_scale * Q
    terminal_scale: float = 5.0  # of Q on position and velocity, where terminal is `scaled` [1]
    max_speed: float = 6.0  # soft box on each component of v_WB [m/s]
    max_tilt: float = 0.9  # soft, angle of body z from world z [rad]
    terminal_radius: float = 1.5  # soft: sqrt(e_N^T P_f e_N) with P_f = P / P_xx, so [m]
    slack_weight: float = 1000.0  # L1 (exact) penalty on each violated set [1 per unit of the set]

    def check(self) -> "MpcConfig":
        """Return self after checking weights, sets and horizon.

        Raises: ValueError: if one is impossible.
        """
        _require(
            1 <= self.horizon <= LONGEST_HORIZON,
            f"horizon must be 1 to {LONGEST_HORIZON} steps; got {self.horizon}",
        )
        _require(
            0 < self.step <= LONGEST_STEP,
            f"step must be positive, {LONGEST_STEP:g} s at most; got {self.step}",
        )
        for name, size in _WEIGHTS.items():
            weight = np.array(getattr(self, name), float)
            _require(
                weight.shape == (size,), f"{name} must have {size} entries; got {weight.shape}"
            )
            _require(
                bool(np.all((weight >= 0) & (weight < np.inf))),
                f"{name} must be finite and not negative; got {weight.tolist()}",
            )
        _require(self.command in COMMANDS, f"command: {' | '.join(COMMANDS)}; got {self.command!r}")
        for name, why in _POSITIVE.items():
            _require(min(getattr(self, name)) > 0, f"{name} must be positive{why}")
        _require(
            0 <= self.weight_swing < np.inf,
            f"weight_swing must be finite and not negative; got {self.weight_swing}",
        )
        for name in ("terminal_scale", "max_speed", "max_tilt", "terminal_radius", "slack_weight"):
            _require(getattr(self, name) > 0, f"{name} must be positive; got {getattr(self, name)}")
        _require(
            self.terminal in ("riccati", "scaled"),
            f"terminal: riccati | scaled; got {self.terminal}",
        )
        _require(self.max_tilt < np.pi, "max_tilt must be below pi [rad]")
        return self

    @property
    def Q(self) -> np.ndarray:
        """Diagonal stage weight, (13,)."""
        return np.array(
            [*self.weight_position, *self.weight_attitude, *self.weight_velocity, *self.weight_rate]
        )

    @property
    def R(self) -> np.ndarray:
        """Diagonal input weight, (4,) [1/N², 1/(N·m)²]."""
        return np.array(self.weight_input, float)

    @property
    def P(self) -> np.ndarray:
        """Diagonal terminal weight of `terminal: scaled`, (13,)."""
        scale = np.ones(13)
        scale[0:3] = scale[7:10] = self.terminal_scale
        return scale * self.Q


class MpcStatus(IntEnum):
    """Origin of an answer; larger is worse."""

    OPTIMAL = 0  # converged to tolerance
    ITERATION_LIMIT = 1  # usable, not converged to tolerance
    SQP_FALLBACK = 2  # IPOPT failed or was late; the SQP answer flies
    SHIFTED_PLAN = 3  # no new answer; the last plan, one step on
    HOVER = 4  # no plan at all; hover input


@dc.dataclass(frozen=True)
class MpcProblem:
    """One receding-horizon problem."""

    x0: np.ndarray  # (13,) measured state
    x_ref: np.ndarray  # (N+1, 13) reference, already shifted with chi_hat
    u_ref: np.ndarray  # (N, 4) likewise [N, N·m]
    forecast: WrenchForecast  # the residual wrench over the horizon, at the MPC's step
    t: float = 0.0  # time of the measurement [s]


@dc.dataclass(frozen=True)
class MpcSolution:
    """Plan of a solver over the horizon."""

    u: np.ndarray  # (N, 4) [N, N·m]
    x: np.ndarray  # (N+1, 13)
    chi: np.ndarray  # (N, 6) [N, N·m]
    status: MpcStatus  # origin of the answer
    cost: float  # [1]
    violation: float  # largest of the soft sets [in each set's unit]
    solve_time: float  # [s]
    iterations: int  # of the outer method


class SolverFailure(RuntimeError):
    """Failure of a solver to give a usable answer, with the reason; the controller falls back."""


class MpcSolver(Protocol):
    """Interface of a solver.

    It has no state but workspaces that every call overwrites wholly.
    """

    name: str

    def solve(self, problem: MpcProblem, warm_start: MpcSolution | None = None) -> MpcSolution:
        """Solve one problem.

        Args:
            problem: of this instant.
            warm_start: an earlier plan, shifted to now; None: there is none.
        Raises: SolverFailure: if no usable answer was found.
        """
        ...


def _require(condition: bool, message: str) -> None:
    if not condition:
        raise ValueError(f"MpcConfig: {message}.")
