"""A trained predictor: encoder, lifted linear system, and where they came from."""

import dataclasses as dc
from typing import Any

import numpy as np

from np_drake.lifting.encoders import DelayEncoder, Phi
from np_drake.lifting.lifted_linear_system import LiftedLinearSystem
from np_drake.lifting.trust import Trust

PAPER, DEFAULT = "paper", "default"


@dc.dataclass(frozen=True)
class LiftedModel:
    """What training yields and a model file holds. Matrices are in physical units: scales are folded in.

    configuration: `paper` (Phi of the instantaneous chi, A and B refit on a window in flight) or `default`
    (linear encoder of the last samples).   system: the offline lifted linear system at the training step.
    window: samples the encoder or the refit needs.   chi_scale, zeta_scale: (6,) scales used in training.
    predicts_torque: whether rows 3:6 of C were trained.   summary: plain figures of the training, for people.
    ridge: weight of `system` in the refit of a window [samples of unit size]; 0 where there is no refit.   trust: how z
    is corrected in flight by the outcome of earlier forecasts; None: not at all.
    """

    configuration: str
    system: LiftedLinearSystem
    encoder: Phi | DelayEncoder
    window: int
    chi_scale: np.ndarray
    zeta_scale: np.ndarray
    predicts_torque: bool
    summary: dict[str, Any] = dc.field(default_factory=dict)
    ridge: float = 0.0
    trust: Trust | None = None

    def __post_init__(self):
        kinds = {PAPER: Phi, DEFAULT: DelayEncoder}
        if self.configuration not in kinds:
            raise ValueError(f"LiftedModel: configuration must be paper | default; got {self.configuration}.")
        if not isinstance(self.encoder, kinds[self.configuration]):
            raise ValueError(
                f"LiftedModel: {self.configuration} must have {kinds[self.configuration].__name__}."
            )
        if self.encoder.K != self.system.K:
            sizes = f"{self.encoder.K} and {self.system.K}"
            raise ValueError(f"LiftedModel: encoder and system must agree on K; got {sizes}.")

    @property
    def step(self) -> float:
        """Time between samples [s]."""
        return self.system.step

    def lift(self, window: np.ndarray) -> np.ndarray:
        """(..., window, 12) samples [chi, zeta], oldest first -> (..., K) z now."""
        if isinstance(self.encoder, DelayEncoder):
            return self.encoder(window)
        return self.encoder(window[..., -1, :6])
