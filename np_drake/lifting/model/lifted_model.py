"""A trained predictor: encoder, lifted linear system and trust."""

import dataclasses as dc
from functools import cached_property
from typing import Any

import numpy as np

from np_drake.lifting.model.adaptive_family import AdaptiveFamily
from np_drake.lifting.model.encoders import DelayEncoder, Phi, Trust
from np_drake.lifting.model.lifted_linear_system import LiftedLinearSystem, advance
from np_drake.lifting.model.neural_family import NeuralFamily

PAPER, LIFTED, NEURAL, MODE_DICTIONARY = "paper", "lifted", "neural", "mode-dictionary"
DMDC, DELAY_DMDC, RIDGE = "dmdc", "delay-dmdc", "ridge"
ENCODERS: dict[
    str, type[Phi] | type[DelayEncoder] | type[AdaptiveFamily]
] = {  # of each configuration, by name
    LIFTED: AdaptiveFamily,
    NEURAL: NeuralFamily,
    PAPER: Phi,
    MODE_DICTIONARY: DelayEncoder,
    DMDC: DelayEncoder,
    DELAY_DMDC: DelayEncoder,
    RIDGE: DelayEncoder,
}
FAMILIES = (
    LIFTED,
    NEURAL,
)  # configurations of many payloads, of which one's own flights only place theta
BY_AXES = {
    "world": LIFTED,
    "body": MODE_DICTIONARY,
}  # configuration that suits flights in these axes alone


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
    # Phi of the instantaneous chi, a linear map of the last samples, or a family of systems that is
    # adapted in flight
    encoder: Phi | DelayEncoder | AdaptiveFamily
    window: int  # samples that are kept: for the encoder, the refit or the update of theta [1]
    chi_scale: np.ndarray  # (6,) scales used in training [N, N·m; m/s, rad/s]
    zeta_scale: np.ndarray  # (6,) scales used in training [N, N·m; m/s, rad/s]
    predicts_torque: bool  # whether rows 3:6 of C were trained
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
        if not isinstance(self.encoder, kind):
            raise ValueError(f"LiftedModel: {self.configuration} must have {kind.__name__}.")
        if self.encoder.K != self.system.K:
            sizes = f"{self.encoder.K} and {self.system.K}"
            raise ValueError(f"LiftedModel: encoder and system must agree on K; got {sizes}.")
        if not 0 <= self.late < self.window:
            raise ValueError(
                f"LiftedModel: late must be 0 to less than the window; got {self.late}."
            )

    @property
    def warm_up(self) -> int:
        """Samples before the first forecast: those that the encoder sees, or that the refit
        reads.
        """
        return self.encoder.delay if isinstance(self.encoder, AdaptiveFamily) else self.window

    @property
    def step(self) -> float:
        """Time between samples [s]."""
        return self.system.step

    @cached_property
    def linear_encoder(self) -> DelayEncoder:
        """Linear encoder of a window: the model's own, or that of its family at the mean of theta.

        Raises: TypeError: where the encoder is a network.
        """
        if isinstance(self.encoder, DelayEncoder):
            return self.encoder
        if isinstance(self.encoder, AdaptiveFamily) and not isinstance(self.encoder, NeuralFamily):
            return self.encoder.encoder(self.encoder.mean)
        raise TypeError(f"LiftedModel: the encoder of {self.configuration} is not linear.")

    @property
    def without_network(self) -> "LiftedModel":
        """Model of the same family without the network, where there is one; else the model
        itself.
        """
        if not isinstance(self.encoder, NeuralFamily):
            return self
        return dc.replace(self, configuration=LIFTED, encoder=self.encoder.plain)

    def lift(self, window: np.ndarray) -> np.ndarray:
        """Return z (..., K) now from samples [chi, zeta] (..., window, 12), oldest first."""
        if isinstance(self.encoder, AdaptiveFamily):
            return self.encoder.read(window, self.encoder.mean)[1]
        if isinstance(self.encoder, DelayEncoder):
            return self.encoder(window)
        z, s = self.encoder(window[..., -1, :6]), self.system
        return advance(z, s.A, s.B, self.since_label(window))

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
    if name not in ENCODERS:
        raise ValueError(f"configuration must be {' | '.join(ENCODERS)}; got {name}. Train again.")
