"""A trained lifted linear system with its encoder and its trust, and its model file."""

import dataclasses as dc
from pathlib import Path
from typing import Any

import numpy as np

from np_drake.checks import require
from np_drake.lifting.model.lifted_linear_system import Encoder, LiftedLinearSystem, Trust
from np_drake.lifting.model.lpv_model import (
    LPV_SCHEMA,
    NEURAL_LPV,
    LpvModel,
    lpv_model_of,
    lpv_tensors,
)
from np_drake.trained_model import STEPS, number_in, read_model, schema_of, summary_in, write_model

PAPER = "paper"
MODE_DICTIONARY = "mode-dictionary"
CONFIGURATIONS = (PAPER, NEURAL_LPV, MODE_DICTIONARY)


@dc.dataclass(frozen=True)
class LiftedModel:
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


Predictor = LiftedModel | LpvModel  # of any configuration


# What a header may hold, own choice: beyond it a file is damaged.
LONGEST = 10_000  # samples of a refit
LARGEST_RIDGE = 1e12  # [samples of unit size]


SCHEMA = "np_drake.lifted_model/3"  # format of the file and its version


def save_model(model: Predictor, path: str | Path) -> None:
    """Write the model file, whole or not at all.
    Raises: OSError: if it cannot be written.
    """
    if isinstance(model, LpvModel):
        header = {"step": model.step, "summary": model.summary}
        return write_model(lpv_tensors(model), LPV_SCHEMA, header, path)
    s = model.system
    tensors = {
        "A": s.A,
        "B": s.B,
        "C": s.C,
        "zeta_scale": model.zeta_scale,
        **model.encoder.tensors(),
    }
    if model.trust is not None:
        tensors |= {
            f"trust/{name}": np.asarray(value, float) for name, value in vars(model.trust).items()
        }
    header = {
        "configuration": model.configuration,
        "step": s.step,
        "refit": model.refit,
        "ridge": model.ridge,
        "summary": model.summary,
    }
    write_model(tensors, SCHEMA, header, path)


def load_model(path: str | Path) -> Predictor:
    """Return the model in a file.

    Raises: ValueError: as `read_model`.
    """
    if schema_of(path) == LPV_SCHEMA:
        return read_model(path, LPV_SCHEMA, lpv_model_of)
    return read_model(path, SCHEMA, _model)


def _model(tensors: dict[str, np.ndarray], header: dict[str, Any]) -> LiftedModel:
    system = LiftedLinearSystem(
        tensors["A"], tensors["B"], tensors["C"], number_in(header, "step", *STEPS)
    )
    radius = system.spectral_radius
    require(radius <= 1.0 + 1e-9, f"A must be stable; its spectral radius is {radius:.6g}.")
    scale = tensors["zeta_scale"]
    require(scale.shape == (6,) and np.all(scale > 0), "zeta_scale must be six positive numbers.")
    return LiftedModel(
        header["configuration"],
        system,
        Encoder.from_tensors(tensors),
        scale,
        summary_in(header),
        refit=int(number_in(header, "refit", 0, LONGEST)),
        ridge=number_in(header, "ridge", 0.0, LARGEST_RIDGE),
        trust=_trust(tensors, system.K),
    )


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
