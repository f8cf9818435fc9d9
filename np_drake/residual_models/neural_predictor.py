"""The Neural Predictor as a residual model: one class, configurations by name."""

import dataclasses as dc
from pathlib import Path

import numpy as np

from np_drake import rigid_body
from np_drake.lifting.lifted_linear_system import LiftedLinearSystem
from np_drake.lifting.lifted_model import PAPER, LiftedModel
from np_drake.lifting.model_file import load_model
from np_drake.lifting.window_refit import WindowRefit
from np_drake.residual_models.base import Memory, Sample, WrenchForecast


@dc.dataclass(frozen=True)
class PredictorOptions:
    """How a trained model flies."""

    torque: str = "hold"  # hold (last low-passed label) | predict
    cutoff: float = 4.0  # of the low-pass on held labels [Hz]
    refit: bool | None = None  # refit A, B on the window in flight; None: as the configuration asks
    ridge: float = 1.0  # weight of the offline A, B in the refit, in samples of unit size [1]


class NeuralPredictor:
    """z = Phi(chi) or E window;  z+ = A z + B zeta;  chi_hat = C z.       Source: Jin et al. 2025, eq. (nmpc).

    Memory: window (W, 12) of [chi, zeta], oldest first; z (K,); A (K, K), B (K, 6); lowpass (6,) of the labels;
    count of samples since the start or the last gap, up to W; dropped, samples without a label so far; gap, of them
    in a row just now. Until `count` reaches W the forecast holds `lowpass`. A missing label is filled with the
    model's own prediction, a missing state with the last zeta; after W in a row the window starts afresh.
    """

    def __init__(self, model: LiftedModel, options: PredictorOptions = PredictorOptions()):
        if options.torque not in ("hold", "predict"):
            raise ValueError(f"NeuralPredictor: torque must be hold | predict; got {options.torque}.")
        if options.torque == "predict" and not model.predicts_torque:
            raise ValueError(
                "NeuralPredictor: this model must not predict torque; it was trained without. Use hold."
            )
        self.name = "np" if model.configuration != PAPER else "np-paper"
        self.step = model.step
        self.model, self.options = model, options
        self._blend = 1.0 - np.exp(-2 * np.pi * options.cutoff * model.step)
        self._C = model.system.C.copy()
        if options.torque == "hold":
            self._C[3:] = 0.0
        refit = model.configuration == PAPER if options.refit is None else options.refit
        self._refit = WindowRefit(model, options.ridge) if refit else None

    @classmethod
    def load(cls, path: str | Path, options: PredictorOptions = PredictorOptions()) -> "NeuralPredictor":
        """From a model file. Raises ValueError with one line on a bad file."""
        return cls(load_model(path), options)

    def initial_memory(self) -> Memory:
        """Nothing seen yet; the forecast is zero."""
        s = self.model.system
        scalars = {name: np.zeros(1) for name in ("count", "dropped", "gap")}
        window = np.zeros((self.model.window, 12))
        return {"window": window, "z": np.zeros(s.K), "A": s.A, "B": s.B, "lowpass": np.zeros(6), **scalars}

    def update(self, memory: Memory, sample: Sample) -> Memory:
        """One more sample; see the class for samples with NaN."""
        chi, zeta, missing = self._filled(memory, sample)
        gap = memory["gap"] + 1.0 if missing else np.zeros(1)
        if missing and (memory["count"][0] == 0 or gap[0] >= self.model.window):
            return {**memory, "count": np.zeros(1), "dropped": memory["dropped"] + 1.0, "gap": gap}
        window = np.concatenate([memory["window"][1:], np.concatenate([chi, zeta])[None]])
        started = memory["dropped"][0] < 0 or memory["lowpass"].any() or memory["count"][0] > 0
        lowpass = memory["lowpass"] + self._blend * (chi - memory["lowpass"]) if started else chi
        count = np.minimum(memory["count"] + 1.0, self.model.window)
        new = {"window": window, "lowpass": lowpass, "count": count, "gap": gap}
        new["dropped"] = memory["dropped"] + float(missing)
        if count[0] < self.model.window:
            return {**memory, **new}
        new["z"] = self.model.lift(window)
        if self._refit is not None:
            new["A"], new["B"] = self._refit(window)
        return {**memory, **new}
