"""What a payload filter learns of a vehicle from its training flight, and the file that carries
it.
"""

import dataclasses as dc
import math
from typing import Any

import numpy as np

from np_drake.checks import require
from np_drake.payload_filter.bank_options import BankOptions
from np_drake.trained_model import ModelFile, summary_in
from np_drake.vehicle.scaling import Scales, over_paper

PAYLOAD_FILTER = "payload_filter"  # name of the configuration
SCHEMA = "np_drake.payload_filter_model/2"  # format of the file and its version
NUMBERS = (
    "step",
    "mass",
    "gravity",
    "rotor_lag",
    "delay",
    "thrust_error",
    "thrust_error_deviation",
    "drag",
    "drag_deviation",
    "arm",
)
LARGEST = 1e6  # of a positive parameter, in any unit; own choice: more is damage
# length, unit
VECTORS = {"hook": (3, "m"), "rate_torque": (3, "N·m·s"), "speed_torque": (2, "N·s")}


@dc.dataclass(frozen=True)
class PayloadFilterModel(ModelFile):
    """Vehicle under which the pendulum hangs, as the training flight shows it, and what is believed
    of payload and air.

    rate_torque: (3,) torque about the body axes over the body rates [N·m·s].
    speed_torque: (2,) torque about body x over the velocity along y, and about y over that along x,
        as of flapping blades and of drag beside Bo [N·s].
    arm: mean distance of the rotors from Bo, the unit of length in which payloads and swings are
        looked for [m].
    """

    step: float  # between samples [s]
    mass: float  # that the labels assume [kg]
    gravity: float  # [m/s²]
    rotor_lag: float  # time constant of the rotors behind the command [s]
    thrust_error: float  # actual over commanded thrust, less one [1]
    thrust_error_deviation: float  # its standard deviation [1]
    drag: float  # of the vehicle over its mass [1/s]
    drag_deviation: float  # its standard deviation [1/s]
    hook: np.ndarray  # (3,) p_BoTo_B [m]
    rate_torque: np.ndarray = dc.field(default_factory=lambda: np.zeros(3))
    speed_torque: np.ndarray = dc.field(default_factory=lambda: np.zeros(2))
    delay: float = 0.0  # of the command before it [s]
    arm: float = dc.field(kw_only=True)
    # In the units of the paper's vehicle
    bank: BankOptions = dc.field(default_factory=BankOptions)
    learned: dict[str, Any] = dc.field(default_factory=dict)  # what its priors were learned on
    # key figures and origin of the training
    summary: dict[str, Any] = dc.field(default_factory=dict)

    configuration = PAYLOAD_FILTER
    schema = SCHEMA

    def __post_init__(self):
        for name in ("step", "mass", "gravity", "thrust_error_deviation", "drag_deviation", "arm"):
            require(
                0 < getattr(self, name) < LARGEST,
                f"PayloadFilterModel: {name} must be positive; got {getattr(self, name)}.",
            )
        delayed = 0 <= self.delay < np.inf and 0 <= self.rotor_lag < np.inf
        require(
            delayed and self.thrust_error > -1 and np.isfinite(self.drag),
            "PayloadFilterModel: delay and rotor_lag must not be negative, thrust_error above "
            "-1, drag finite.",
        )
        for name, (length, unit) in VECTORS.items():
            value = getattr(self, name)
            require(
                np.shape(value) == (length,) and np.all(np.isfinite(value)),
                f"PayloadFilterModel: {name} must be {length} finite numbers [{unit}]; "
                f"got {value}.",
            )

    @property
    def unit(self) -> Scales:
        """Units of length, mass and time over those of the paper's vehicle, which are exactly 1 for
        the latter.
        """
        return over_paper(Scales(self.arm, self.mass, math.sqrt(self.arm / self.gravity)))

    def content(self) -> tuple[dict[str, np.ndarray], dict[str, Any]]:
        """Return the arrays and the header of its file."""
        tensors = {name: np.array([getattr(self, name)], float) for name in NUMBERS}
        tensors |= {name: np.asarray(getattr(self, name), float) for name in VECTORS}
        header = {"summary": self.summary, "bank": self.bank.as_numbers(), "learned": self.learned}
        return tensors, header

    @classmethod
    def of_content(
        cls, tensors: dict[str, np.ndarray], header: dict[str, Any]
    ) -> "PayloadFilterModel":
        """Return the model of the content of a file."""
        content: dict[str, Any] = {name: tensors[name].item() for name in NUMBERS}
        content |= {name: tensors[name] for name in VECTORS}
        bank = BankOptions.of_numbers(header["bank"])
        learned = dict(header["learned"])
        return cls(**content, bank=bank, learned=learned, summary=summary_in(header))
