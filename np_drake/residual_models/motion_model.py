"""Residual models without memory: the wrench is a function of the motion at the same instant."""

import dataclasses as dc
import json
from pathlib import Path
from typing import Any

import numpy as np

from np_drake import rigid_body
from np_drake.lifting.model.model_file import read_tensors, write_tensors
from np_drake.residual_models.base import Memory, Sample, WrenchForecast, constant_forecast
from np_drake.residual_models.gaussian_process import GaussianProcess
from np_drake.residual_models.wrench_network import WrenchNetwork

GP, KNODE = "gp", "knode"
REACTIONS: dict[str, type[GaussianProcess] | type[WrenchNetwork]] = {
    GP: GaussianProcess,
    KNODE: WrenchNetwork,
}
SCHEMA = "np_drake.motion_model/1"


@dc.dataclass
class MotionModel:
    """chi_i = g(zeta_i) at every predicted state.      Source: Torrente et al. 2021 (gp), Chee et al. 2022 (knode).

    It never looks at a label in flight: what changes there, it does not see.

    name: gp | knode.   reaction: g.   step: time between samples [s].   summary: how it was trained.
    """

    name: str
    reaction: GaussianProcess | WrenchNetwork
    step: float
    summary: dict[str, Any] = dc.field(default_factory=dict)

    def __post_init__(self):
        if self.name not in REACTIONS or not isinstance(self.reaction, REACTIONS[self.name]):
            raise ValueError(
                f"MotionModel: name must be {' | '.join(REACTIONS)}, as its reaction is; got {self.name}."
            )
        if not 0 < self.step < np.inf:
            raise ValueError(f"MotionModel: step must be positive [s]; got {self.step}.")

    def initial_memory(self) -> Memory:
        """zeta (6,) last measured [m/s, rad/s]."""
        return {"zeta": np.zeros(6)}

    def update(self, memory: Memory, sample: Sample) -> Memory:
        """Takes the motion in; a sample with NaN leaves the last one."""
        zeta = rigid_body.zeta(np.asarray(sample.x, float))
        return {"zeta": zeta.copy()} if np.all(np.isfinite(zeta)) else memory

    def forecast(self, memory: Memory, *, horizon: int, stride: int) -> WrenchForecast:
        """The function itself, for the controller to evaluate where it plans to be."""
        silent = constant_forecast(np.zeros(6), horizon)
        return dc.replace(silent, reaction=self.reaction, zeta=memory["zeta"])

    def along(self, chi: np.ndarray, zeta: np.ndarray) -> "MotionForecasts":
        """All forecasts of a flight without gaps."""
        return MotionForecasts(0, self.reaction(zeta))

    def save(self, path: str | Path) -> None:
        """Writes the model file, whole or not at all. Raises OSError where it cannot be written."""
        header = {"name": self.name, "step": self.step, "summary": self.summary}
        write_tensors(self.reaction.tensors(), {"schema": SCHEMA, "model": json.dumps(header)}, path)

    @classmethod
    def load(cls, path: str | Path, name: str | None = None) -> "MotionModel":
        """The model in a file; `name`, where given, must be the file's.

        Raises: ValueError: one line, on a missing, truncated, pickled, foreign or inconsistent file.
        """
        tensors, metadata = read_tensors(path, SCHEMA)
        try:
            header = json.loads(metadata["model"])
            reaction = REACTIONS[header["name"]].from_tensors(tensors)
            model = cls(header["name"], reaction, float(header["step"]), dict(header["summary"]))
        except (KeyError, TypeError, ValueError) as error:
            what = f"lacks {error}" if isinstance(error, KeyError) else str(error).splitlines()[0]
            raise ValueError(f"{path}: not a usable model file: {what}") from error
        if name is not None and model.name != name:
            raise ValueError(f"{path}: the model must be {name}; got {model.name}.")
        return model


@dc.dataclass
class MotionForecasts:
    """Those of a whole flight. course: (n, 6) chi at its own motion [N, N·m]."""

    first: int
    course: np.ndarray

    def at(
        self, horizons: list[int], origins: np.ndarray, zeta: np.ndarray, *, zeta_known: bool
    ) -> np.ndarray:
        """(o, len(horizons), 6) chi_hat; the coming motion known, or held at its last value."""
        rows = origins[:, None] + np.array(horizons) * zeta_known
        return self.course[rows]
