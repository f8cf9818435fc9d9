"""Residual models without memory: the wrench as a function of the motion at the same instant."""

import dataclasses as dc
from pathlib import Path
from typing import Any

import numpy as np

from np_drake import rigid_body
from np_drake.lifting.model.model_file import read_model, write_model
from np_drake.lifting.model.model_header import STEPS, number_in, summary_in
from np_drake.residual_model import Memory, Sample, WrenchForecast, constant_forecast
from np_drake.residual_models.gaussian_process import GaussianProcess
from np_drake.residual_models.wrench_network import WrenchNetwork

GP, KNODE = "gp", "knode"  # names
REACTIONS: dict[str, type[GaussianProcess] | type[WrenchNetwork]] = {
    GP: GaussianProcess,
    KNODE: WrenchNetwork,
}
SCHEMA = "np_drake.motion_model/1"  # format of the file and its version


@dc.dataclass
class MotionModel:
    """Residual model chi_i = g(zeta_i), evaluated at every predicted state.

    It uses no label in flight, so that it cannot follow a change of the wrench at equal motion.
    Source: Torrente et al. 2021 (gp), Chee et al. 2022 (knode).
    """

    name: str  # gp | knode
    reaction: GaussianProcess | WrenchNetwork  # g
    step: float  # time between samples [s]
    summary: dict[str, Any] = dc.field(default_factory=dict)  # key figures of the training

    def __post_init__(self):
        if self.name not in REACTIONS or not isinstance(self.reaction, REACTIONS[self.name]):
            raise ValueError(
                f"MotionModel: name must be {' | '.join(REACTIONS)}, as its reaction is; "
                f"got {self.name}."
            )
        if not 0 < self.step < np.inf:
            raise ValueError(f"MotionModel: step must be positive [s]; got {self.step}.")

    def initial_memory(self) -> Memory:
        """Return the memory before any sample: zeta (6,) last measured [m/s, rad/s]."""
        return {"zeta": np.zeros(6)}

    def update(self, memory: Memory, sample: Sample) -> Memory:
        """Return the memory after one more sample; one with NaN leaves it as it is."""
        zeta = rigid_body.zeta(np.asarray(sample.x, float))
        return {"zeta": zeta.copy()} if np.all(np.isfinite(zeta)) else memory

    def forecast(self, memory: Memory, *, horizon: int, stride: int) -> WrenchForecast:
        """Return a forecast with the function itself, which the controller evaluates along its
        plan.
        """
        silent = constant_forecast(np.zeros(6), horizon)
        return dc.replace(silent, reaction=self.reaction, zeta=memory["zeta"])

    def along(self, chi: np.ndarray, zeta: np.ndarray) -> "MotionForecasts":
        """Return all forecasts of a flight chi, zeta (n, 6) without gaps; chi is not used."""
        return MotionForecasts(0, self.reaction(zeta))

    def save(self, path: str | Path) -> None:
        """Write the model file, whole or not at all.

        Raises: OSError: if it cannot be written.
        """
        header = {"name": self.name, "step": self.step, "summary": self.summary}
        write_model(self.reaction.tensors(), SCHEMA, header, path)

    @classmethod
    def load(cls, path: str | Path, name: str | None = None) -> "MotionModel":
        """Return the model in a file.

        Args:
            name: where given, the name that the file must hold.
        Raises: ValueError: as `read_model`.
        """
        model = read_model(path, SCHEMA, cls._build)
        if name is not None and model.name != name:
            raise ValueError(f"{path}: the model must be {name}; got {model.name}.")
        return model

    @classmethod
    def _build(cls, tensors: dict[str, np.ndarray], header: dict[str, Any]) -> "MotionModel":
        reaction = REACTIONS[header["name"]].from_tensors(tensors)
        return cls(header["name"], reaction, number_in(header, "step", *STEPS), summary_in(header))


@dc.dataclass
class MotionForecasts:
    """Forecasts of a `MotionModel` over a whole flight."""

    first: int  # first sample
    course: np.ndarray  # (n, 6) chi at each sample's own motion [N, N·m]

    def at(
        self, horizons: list[int], origins: np.ndarray, zeta: np.ndarray, *, zeta_known: bool
    ) -> np.ndarray:
        """Return chi_hat (o, len(horizons), 6) [N, N·m], with the coming motion known or held at
        its last value.
        """
        rows = origins[:, None] + np.array(horizons) * zeta_known
        return self.course[rows]
