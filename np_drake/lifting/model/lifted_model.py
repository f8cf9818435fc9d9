"""A trained lifted linear system with its encoder and its trust, and its model file."""

import dataclasses as dc
from pathlib import Path
from typing import Any

import numpy as np

from np_drake.checks import require
from np_drake.lifting.model.lifted_linear_system import Encoder, LiftedLinearSystem, Trust
from np_drake.lifting.model.lpv_model import NEURAL_LPV, LpvModel
from np_drake.trained_model import STEPS, ModelFile, number_in, schema_of, summary_in

PAPER = "paper"
MODE_DICTIONARY = "mode-dictionary"
SCHEMA = "np_drake.lifted_model/3"  # format of the file and its version
CONFIGURATIONS = (PAPER, NEURAL_LPV, MODE_DICTIONARY)


# What a header may hold, own choice: beyond it a file is damaged.
LONGEST = 10_000  # samples of a refit
LARGEST_RIDGE = 1e12  # [samples of unit size]


@dc.dataclass(frozen=True)
class LiftedModel(ModelFile):
    """Trained predictor as held by a model file, with all matrices in physical units.

    refit: samples that A and B are fitted to in flight, about those of `system`; 0 for no refit.
    ridge: precision of `system` as the prior of a refit [samples of unit size].
    trust: correction of z in flight by the outcome of earlier forecasts; None for none.
    """

    # of `CONFIGURATIONS`; a label only, as all that flies is in the other fields
    configuration: str
    system: LiftedLinearSystem  # offline lifted linear system at the training step
    encoder: Encoder
    zeta_scale: np.ndarray = dc.field(default_factory=lambda: np.ones(6))  # in a refit [m/s, rad/s]
    # key figures of the training, for people
    summary: dict[str, Any] = dc.field(default_factory=dict)
    refit: int = 0
    ridge: float = 0.0
    trust: Trust | None = None

    schema = SCHEMA

    def __post_init__(self):
        require(
            self.configuration in CONFIGURATIONS,
            f"configuration must be {' | '.join(CONFIGURATIONS)}; got {self.configuration}. "
            "Train again.",
        )
        require(
            self.encoder.K == self.system.K,
            f"LiftedModel: encoder and system must agree on K; got {self.encoder.K} and "
            f"{self.system.K}.",
        )
        require(
            self.refit == 0 or (self.refit > 1 and self.ridge > 0),
            f"LiftedModel: a refit must have two samples and a positive ridge; got {self.refit}, "
            f"{self.ridge}.",
        )

    @property
    def window(self) -> int:
        """Samples from which the first forecast is made."""
        return self.encoder.delay

    @property
    def step(self) -> float:
        """Time between samples [s]."""
        return self.system.step

    def content(self) -> tuple[dict[str, np.ndarray], dict[str, Any]]:
        """Return the arrays and the header of its file."""
        s = self.system
        tensors = {"A": s.A, "B": s.B, "C": s.C, "zeta_scale": self.zeta_scale}
        tensors |= self.encoder.tensors()
        if self.trust is not None:
            tensors |= {
                f"trust/{name}": np.asarray(value, float)
                for name, value in vars(self.trust).items()
            }
        header = {
            "configuration": self.configuration,
            "step": s.step,
            "refit": self.refit,
            "ridge": self.ridge,
            "summary": self.summary,
        }
        return tensors, header

    @classmethod
    def of_content(cls, tensors: dict[str, np.ndarray], header: dict[str, Any]) -> "LiftedModel":
        """Return the model of the content of a file."""
        step = number_in(header, "step", *STEPS)
        system = LiftedLinearSystem(tensors["A"], tensors["B"], tensors["C"], step)
        radius = system.spectral_radius
        require(radius <= 1.0 + 1e-9, f"A must be stable; its spectral radius is {radius:.6g}.")
        scale = tensors["zeta_scale"]
        require(
            scale.shape == (6,) and np.all(scale > 0), "zeta_scale must be six positive numbers."
        )
        return cls(
            header["configuration"],
            system,
            Encoder.from_tensors(tensors),
            scale,
            summary_in(header),
            refit=int(number_in(header, "refit", 0, LONGEST)),
            ridge=number_in(header, "ridge", 0.0, LARGEST_RIDGE),
            trust=_trust(tensors, system.K),
        )


Predictor = LiftedModel | LpvModel  # of any configuration


def load_model(path: str | Path) -> Predictor:
    """Return the model in a file.

    Raises: ValueError: as `read_model`.
    """
    return LpvModel.load(path) if schema_of(path) == LpvModel.schema else LiftedModel.load(path)


def _trust(tensors: dict[str, np.ndarray], K: int) -> Trust | None:
    entries = {
        name.removeprefix("trust/"): value
        for name, value in tensors.items()
        if name.startswith("trust/")
    }
    if not entries:
        return None
    horizons = entries.pop("horizons").astype(int)
    arrays = {name: entries.pop(name) for name in ("readout", "projector", "mean")}
    H = len(horizons)
    shapes = {"readout": (H, 6, K), "projector": (K, H, 6), "mean": (6,)}
    require(
        all(arrays[name].shape == shape for name, shape in shapes.items()),
        f"the arrays of trust must be {shapes}.",
    )
    require(
        H != 0 and horizons[0] >= 1 and not np.any(np.diff(horizons) < 1),
        "the horizons of trust must be whole numbers from 1 on, ascending.",
    )
    return Trust(
        horizons,
        arrays["readout"],
        arrays["projector"],
        arrays["mean"],
        **{name: value.item() for name, value in entries.items()},
    )
