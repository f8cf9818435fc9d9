"""Data of one NP-MPC problem: configuration, horizon data, solution and status."""

import dataclasses as dc
from enum import IntEnum
from typing import Protocol

import numpy as np

from np_drake.files.yaml_file import POSITIVE, check_fields, number, word
from np_drake.residual_model import WrenchForecast

COMMANDS = ("rotors", "rates")  # what an MPC may decide on


@dc.dataclass
class MpcConfig:
    """Weights and sets of problem (nmpc).

    The error e_x is x - x* in the 13 state components.
    Source of the weights: tuned on the vehicle without payload, then frozen.
    """

    # number of steps N, 200 at most (own choice: ten times the usual, and 100 MB of matrices)
    horizon: int = number(20, "1", 1, 200)
    # a whole multiple of the controller's period, 10 s at most
    step: float = number(0.04, "s", POSITIVE, 10.0)
    # Q on position, which the terminal set needs
    weight_position: list[float] = number([160.0, 160.0, 320.0], "1/m²", POSITIVE)
    # Q on the quaternion's components
    weight_attitude: list[float] = number([1.0, 5.0, 5.0, 5.0], "1", 0.0)
    weight_velocity: list[float] = number([2.0, 2.0, 2.0], "s²/m²", 0.0)  # Q on velocity
    weight_rate: list[float] = number([0.03, 0.03, 0.03], "s²/rad²", 0.0)  # Q on body rates
    # R on thrust and torques
    weight_input: list[float] = number([0.02, 18.0, 18.0, 45.0], "1/N², 1/(N·m)²", POSITIVE)
    # rotors: thrust and torque | rates: rates and collective thrust, set by an autopilot
    command: str = word("rotors", *COMMANDS)
    # R on commanded body rates, with command `rates`
    weight_rates: list[float] = number([0.3, 0.3, 0.3], "s²/rad²", POSITIVE)
    # on the predicted lateral force, to damp a payload's swing; 0: off
    weight_swing: float = number(0.0, "1/N²", 0.0)
    # P: riccati: cost-to-go at hover | scaled: terminal_scale * Q
    terminal: str = word("riccati", "riccati", "scaled")
    # of Q on position and velocity, where terminal is `scaled`
    terminal_scale: float = number(5.0, "1", POSITIVE)
    max_speed: float = number(6.0, "m/s", POSITIVE)  # soft, on each component of velocity
    max_tilt: float = number(0.9, "rad", POSITIVE, 3.14)  # soft, angle of body z from world z
    # soft ellipsoid on the last state: sqrt(e_N^T P_f e_N), P_f = P / P_xx
    terminal_radius: float = number(1.5, "m", POSITIVE)
    # exact L1 penalty on each violated set
    slack_weight: float = number(1000.0, "1 per unit of the set", POSITIVE)

    def __post_init__(self) -> None:
        """Raises: ValueError: as `check`."""
        self.check()

    def check(self) -> "MpcConfig":
        """Return self after checking weights, sets and horizon.

        Raises: ValueError: if one is impossible.
        """
        check_fields(self, "MpcConfig")
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
    # (4,) thrust and torque of the rotors, which lag; None: those of u_ref [N, N·m]
    acting: np.ndarray | None = None


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
