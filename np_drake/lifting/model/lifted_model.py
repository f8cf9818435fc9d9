"""A trained lifted linear system with its encoder and its trust, and its model file."""

import dataclasses as dc
from pathlib import Path
from typing import Any

import numpy as np

from np_drake.checks import require
from np_drake.lifting.model.lifted_linear_system import DelayEncoder, LiftedLinearSystem, Phi, Trust
from np_drake.trained_model import STEPS, number_in, read_model, summary_in, write_model

PAPER, MODE_DICTIONARY = "paper", "mode-dictionary"
# Encoder of each configuration, by name
ENCODERS: dict[str, type[Phi] | type[DelayEncoder]] = {PAPER: Phi, MODE_DICTIONARY: DelayEncoder}


@dc.dataclass(frozen=True)
class LiftedModel:
    """Trained predictor as held by a model file, with all matrices in physical units.

    late: samples by which the labels that Phi sees lag behind the wrench; z is taken to the present
    by the zeta since.
    trust: correction of z in flight by the outcome of earlier forecasts; None for none.
    """

    configuration: (
        str  # a key of `ENCODERS`; a label only, as all that flies is in the other fields
    )
    system: LiftedLinearSystem  # offline lifted linear system at the training step
    encoder: Phi | DelayEncoder  # of the instantaneous chi, or a linear map of the last samples
    window: int  # samples that the encoder sees, or that the refit reads [1]
    chi_scale: np.ndarray  # (6,) scales used in training [N, N·m; m/s, rad/s]
    zeta_scale: np.ndarray  # (6,) scales used in training [N, N·m; m/s, rad/s]
    summary: dict[str, Any] = dc.field(
        default_factory=dict
    )  # key figures of the training, for people
    ridge: float = (
        0.0  # precision of `system` as the prior of a refit [samples of unit size]; 0 for no refit
    )
    late: int = 0
    trust: Trust | None = None

    def __post_init__(self):
        require_configuration(self.configuration)
        kind = ENCODERS[self.configuration]
        require(
            isinstance(self.encoder, kind),
            f"LiftedModel: {self.configuration} must have {kind.__name__}.",
        )
        require(
            self.encoder.K == self.system.K,
            f"LiftedModel: encoder and system must agree on K; got {self.encoder.K} and "
            f"{self.system.K}.",
        )
        require(
            0 <= self.late < self.window,
            f"LiftedModel: late must be 0 to less than the window; got {self.late}.",
        )

    @property
    def step(self) -> float:
        """Time between samples [s]."""
        return self.system.step

    def since_label(self, window: np.ndarray) -> np.ndarray:
        """Return the zeta (..., late, 6) from the time of the newest label on, of samples (..., n,
        12).
        """
        n = window.shape[-2]
        return window[..., n - 1 - self.late : n - 1, 6:]


def require_configuration(name: str) -> None:
    """Check that a configuration of that name exists.

    Raises: ValueError: if there is none.
    """
    require(
        name in ENCODERS, f"configuration must be {' | '.join(ENCODERS)}; got {name}. Train again."
    )


# What a header may hold, own choice: beyond it a file is damaged.
LONGEST_WINDOW, LARGEST_RIDGE = 100_000, 1e12


SCHEMA = "np_drake.lifted_model/1"  # format of the file and its version


def save_model(model: LiftedModel, path: str | Path) -> None:
    """Write the model file, whole or not at all.
    Raises: OSError: if it cannot be written.
    """
    s = model.system
    tensors = {
        "A": s.A,
        "B": s.B,
        "C": s.C,
        "chi_scale": model.chi_scale,
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
        "window": model.window,
        "ridge": model.ridge,
        "summary": model.summary,
    }
    if model.late:
        header["late"] = model.late
    write_model(tensors, SCHEMA, header, path)


def load_model(path: str | Path) -> LiftedModel:
    """Return the model in a file.

    Raises: ValueError: as `read_model`.
    """
    return read_model(path, SCHEMA, _model)


def _model(tensors: dict[str, np.ndarray], header: dict[str, Any]) -> LiftedModel:
    configuration = str(header["configuration"])
    window = int(number_in(header, "window", 1, LONGEST_WINDOW))
    require_configuration(configuration)
    system = LiftedLinearSystem(
        tensors["A"], tensors["B"], tensors["C"], number_in(header, "step", *STEPS)
    )
    if system.spectral_radius > 1.0 + 1e-9:
        raise ValueError(f"A must be stable; its spectral radius is {system.spectral_radius:.6g}.")
    for name in ("chi_scale", "zeta_scale"):
        require(
            tensors[name].shape == (6,) and np.all(tensors[name] > 0),
            f"{name} must be six positive numbers.",
        )
    encoder = ENCODERS[configuration].from_tensors(tensors)
    return LiftedModel(
        configuration,
        system,
        encoder,
        window,
        tensors["chi_scale"],
        tensors["zeta_scale"],
        summary_in(header),
        number_in(header, "ridge", 0.0, LARGEST_RIDGE),
        int(number_in({"late": 0} | header, "late", 0, LONGEST_WINDOW)),
        _trust(tensors, system.K),
    )


def _trust(tensors: dict[str, np.ndarray], K: int) -> Trust | None:
    found = {
        name.removeprefix("trust/"): value
        for name, value in tensors.items()
        if name.startswith("trust/")
    }
    if not found:
        return None
    horizons = found.pop("horizons").astype(int)
    arrays = {name: found.pop(name) for name in ("readout", "projector", "mean")}
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
        **{name: value.item() for name, value in found.items()},
    )
