"""Configuration of a controller, and of the autopilot that may stand behind it."""

import dataclasses as dc
from pathlib import Path

import numpy as np

from diagrams.batch.run import require
from diagrams.loop.own_controller import is_own
from np_drake.autopilot.betaflight import BetaflightConfig
from np_drake.command_delay import LONGEST_DELAY
from np_drake.files.yaml_file import check_fields, number, word
from np_drake.labels import LabelConfig
from np_drake.mpc.problem import MpcConfig
from np_drake.mpc.solvers import require_solver
from np_drake.payload_filter.model_file import PAYLOAD_FILTER
from np_drake.residual_models.motion_model import REACTIONS
from np_drake.vehicle import Vehicle

MODELS = Path(__file__).parents[1] / "models"  # that ship with the package
SHORTEST_PERIOD = 1e-4  # of the controller [s]; own choice
NP_MODEL = MODELS / "neural_predictor.safetensors"  # of payloads as were drawn in its training
FILTER_MODEL = MODELS / "payload_filter.safetensors"  # of any tethered payload
LEARNED = ("np", PAYLOAD_FILTER, *REACTIONS)  # kinds with a model file
NONE = "none"  # no autopilot: the rotors take thrust and torque at once
AUTOPILOTS = (NONE, "rate_loop", "betaflight")
CONTROLLERS = ("nominal", "hold", "observer", "oracle", "cascade", *LEARNED)  # all kinds


@dc.dataclass
class ControllerConfig:
    """Kind of controller, its residual model, solver and timing."""

    # nominal | hold | observer | oracle | cascade | np | payload_filter | gp | knode, or one's own:
    # MODULE:NAME
    kind: str = "nominal"
    parameters: dict[str, float] = dc.field(default_factory=dict)  # of one's own, by name
    vehicle: Vehicle | None = None  # that controller and estimator assume; None: the one that flies
    extra_mass: float = number(0.0, "kg", 0)  # that they add to its mass
    # model file of a learned kind; np, payload_filter: empty for the packaged one
    predictor: str = ""
    # between solves, and between samples of the predictor
    period: float = number(0.02, "s", SHORTEST_PERIOD)
    command_delay: float = 0.0  # of commands before the rotors' lag; 0: as trained [s]
    track_delay: bool = False  # follow the delay in flight; a model that knows its own always does
    solver: str = "sqp"  # sqp | ipopt
    deadline: float = np.inf  # a later answer is discarded; solvers wrap up at half of it [s]
    mpc: MpcConfig = dc.field(default_factory=MpcConfig)
    label: LabelConfig = dc.field(default_factory=LabelConfig)

    def __post_init__(self) -> None:
        """Raises: ValueError: where a number is outside its bounds."""
        check_fields(self, "controller")

    def check(self) -> "ControllerConfig":
        """Return self after checking kind, solver and steps.

        Raises: ValueError: on an unknown kind or solver or steps that do not fit.
        """
        self.mpc.check()
        self.label.check()
        if self.vehicle is not None:
            self.vehicle.check()
        users = is_own(self.kind)
        require(
            users or self.kind in CONTROLLERS,
            f"controller: must be one of {', '.join(CONTROLLERS)}, or MODULE:NAME of your own; "
            f"got {self.kind!r}.",
        )
        require(
            users or not self.parameters,
            f"controller: parameters are of one of your own (MODULE:NAME); got kind {self.kind}.",
        )
        require_solver(self.solver)
        check_fields(self, "controller")
        require(self.deadline > 0, "controller: deadline must be positive [s].")
        require(
            0 <= self.command_delay <= LONGEST_DELAY * self.period,
            f"controller: command_delay must be 0 to {LONGEST_DELAY} periods, "
            f"{LONGEST_DELAY * self.period:g} s for this vehicle; got {self.command_delay:g} s.",
        )
        require(
            not self.predictor or self.kind in LEARNED,
            f"controller: a predictor is for kind {', '.join(LEARNED)}; got {self.kind}.",
        )
        require(
            bool(self.predictor) or self.kind not in REACTIONS,
            f"controller: kind {self.kind} needs its model file (predictor); "
            f"np-drake train LOG --configuration {self.kind} makes one.",
        )
        require(
            abs(self.stride * self.period - self.mpc.step) <= 1e-9,
            f"controller: mpc.step must be a whole multiple of period; got {self.mpc.step}, "
            f"{self.period}.",
        )
        return self

    def believed(self, vehicle: Vehicle) -> Vehicle:
        """Return the vehicle that controller and estimator assume where `vehicle` flies."""
        assumed = self.vehicle or vehicle
        return assumed.with_mass(assumed.mass + self.extra_mass)

    @property
    def name(self) -> str:
        """Kind, or the name alone of one's own."""
        return self.kind.rpartition(":")[2]

    @property
    def stride(self) -> int:
        """Number of predictor steps in one MPC step."""
        return max(1, round(self.mpc.step / self.period))


@dc.dataclass
class AutopilotConfig:
    """What stands between the controller and the rotors."""

    # none | rate_loop: as the vehicle file says | betaflight: its firmware
    kind: str = word(NONE, *AUTOPILOTS)
    betaflight: BetaflightConfig = dc.field(default_factory=BetaflightConfig)

    def __post_init__(self) -> None:
        """Raises: ValueError: where a number is outside its bounds."""
        check_fields(self, "autopilot")

    def check(self) -> "AutopilotConfig":
        """Return self after checking all values.

        Raises: ValueError: where one is impossible.
        """
        check_fields(self, "autopilot")
        self.betaflight.check()
        return self

    @property
    def flies(self) -> bool:
        """Whether there is an autopilot, which follows body rates."""
        return self.kind != NONE
