"""Configuration of a controller: its kind, residual model, solver and timing."""

import dataclasses as dc
from pathlib import Path

import numpy as np

from diagrams.loop.own_controller import is_own
from np_drake.command_delay import LONGEST_DELAY
from np_drake.labels import LabelConfig
from np_drake.mpc.problem import MpcConfig
from np_drake.mpc.solvers import require_solver
from np_drake.payload_filter.model_file import PAYLOAD_FILTER
from np_drake.residual_models.motion_model import REACTIONS
from np_drake.vehicle import Vehicle

MODELS = Path(__file__).parents[1] / "models"  # that ship with the package
SHORTEST_PERIOD = 1e-4  # of the controller [s]; own choice
NP_MODEL = MODELS / "neural_predictor.safetensors"  # lifted linear system of any residual wrench
FILTER_MODEL = MODELS / "payload_filter.safetensors"  # of the vehicle, for any tethered payload
LEARNED = ("np", PAYLOAD_FILTER, *REACTIONS)  # kinds with a model file
CONTROLLERS = ("nominal", "hold", "observer", "oracle", "cascade", *LEARNED)  # all kinds


@dc.dataclass
class ControllerConfig:
    """Kind of controller, its residual model, solver and timing."""

    # nominal | hold | observer | oracle | cascade | np | payload_filter | gp | knode, or one's own:
    # MODULE:NAME
    kind: str = "nominal"
    parameters: dict[str, float] = dc.field(default_factory=dict)  # of one's own, by name
    extra_mass: float = 0.0  # that controller and estimator add to the vehicle's [kg]
    hold_bandwidth: float = np.inf  # of kind hold: a low-pass on top of the labels' own [Hz]
    predictor: str = (
        ""  # model file of a learned kind; np, payload_filter: empty for the packaged one
    )
    period: float = 0.02  # between solves, and between samples of the predictor [s]
    command_delay: float = 0.0  # of commands before the rotors' lag; 0: as trained [s]
    track_delay: bool = False  # follow the delay in flight; a model that knows its own always does
    solver: str = "sqp"  # sqp | ipopt
    deadline: float = np.inf  # a later answer is discarded; solvers wrap up at half of it [s]
    mpc: MpcConfig = dc.field(default_factory=MpcConfig)
    label: LabelConfig = dc.field(default_factory=LabelConfig)

    def check(self) -> "ControllerConfig":
        """Return self after checking kind, solver and steps.

        Raises: ValueError: on an unknown kind or solver or steps that do not fit.
        """
        self.mpc.check()
        self.label.check()
        if self.kind not in CONTROLLERS and not is_own(self.kind):
            raise ValueError(
                f"controller: must be one of {', '.join(CONTROLLERS)}, or MODULE:NAME of "
                f"your own; got {self.kind!r}."
            )
        if self.parameters and not is_own(self.kind):
            raise ValueError(
                f"controller: parameters are of one of your own (MODULE:NAME); got kind "
                f"{self.kind}."
            )
        require_solver(self.solver)
        if not SHORTEST_PERIOD <= self.period < np.inf:
            raise ValueError(
                f"controller: period must be at least {SHORTEST_PERIOD:g} s; got {self.period}."
            )
        if not self.deadline > 0 or not self.hold_bandwidth > 0:
            raise ValueError("controller: deadline [s] and hold_bandwidth [Hz] must be positive.")
        if not 0 <= self.command_delay <= LONGEST_DELAY * self.period:
            raise ValueError(
                f"controller: command_delay must be 0 to {LONGEST_DELAY} periods, "
                f"{LONGEST_DELAY * self.period:g} s "
                f"for this vehicle; got {self.command_delay:g} s."
            )
        if not 0 <= self.extra_mass < np.inf:
            raise ValueError(
                f"controller: extra_mass must be finite and not negative [kg]; got "
                f"{self.extra_mass}."
            )
        if self.predictor and self.kind not in LEARNED:
            raise ValueError(
                f"controller: a predictor is for kind {', '.join(LEARNED)}; got {self.kind}."
            )
        if self.kind in REACTIONS and not self.predictor:
            raise ValueError(
                f"controller: kind {self.kind} needs its model file (predictor); "
                f"np-drake train LOG --configuration {self.kind} makes one."
            )
        if abs(self.stride * self.period - self.mpc.step) > 1e-9:
            raise ValueError(
                f"controller: mpc.step must be a whole multiple of period; got "
                f"{self.mpc.step}, {self.period}."
            )
        return self

    def believed(self, vehicle: Vehicle) -> Vehicle:
        """Return the vehicle that controller and estimator assume."""
        return vehicle.with_mass(vehicle.mass + self.extra_mass)

    @property
    def name(self) -> str:
        """Kind, or the name alone of one's own."""
        return self.kind.rpartition(":")[2]

    @property
    def stride(self) -> int:
        """Number of predictor steps in one MPC step."""
        return max(1, round(self.mpc.step / self.period))
