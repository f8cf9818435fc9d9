"""A lifted linear system as a residual model, `paper` with a refit of its matrices in flight."""

import dataclasses as dc
from pathlib import Path

import numpy as np
from scipy.linalg import lapack

from np_drake import rigid_body
from np_drake.checks import require
from np_drake.lifting.model.lifted_linear_system import (
    RADIUS,
    DelayEncoder,
    LiftedLinearSystem,
    Phi,
    advance,
    stabilized,
)
from np_drake.lifting.model.lifted_model import MODE_DICTIONARY, LiftedModel, load_model
from np_drake.residual_model import Memory, Sample, WrenchForecast
from np_drake.trained_model import rotor_lag_of

CUTOFF = 4.0  # of the low-pass on held labels [Hz]


class NeuralPredictor:
    """Predictor of the paper, z = Phi(chi) or E window;  z+ = A z + B zeta;  chi_hat = C z.

    A label that is known to be late is lifted at its own time, and z then taken to the present with
    the zeta since.

    Memory: window (W, 12) of [chi, zeta], oldest first; z (K,); where A (K, K) and B (K, 6) change
    in flight, these; of a refit rows (W - late, K + 6), the window as it reads it, so that every
    sample is lifted once; lowpass (6,) of the labels; count of samples in the window, up to W;
    labels, dropped: samples with and without one so far; gap: dropped in a row just now; where the
    model has a `trust`, its memory, as trust/…. Until the window is full the forecast holds
    `lowpass`. A missing label is filled with the model's own prediction, a missing state with the
    last zeta; after W samples in a row without, the window starts afresh.
    Source: Jin et al. 2025, eq. (nmpc).

    Args:
        model: of any configuration.
        torque: hold (last low-passed label) | predict.
    """

    def __init__(self, model: LiftedModel, *, torque: str = "hold"):
        require(
            torque in ("hold", "predict"),
            f"NeuralPredictor: torque must be hold | predict; got {torque}.",
        )
        own = model.configuration == MODE_DICTIONARY
        self.name = "np" if own else f"np-{model.configuration}"
        self.model, self.step = model, model.step
        self.rotor_lag = rotor_lag_of(model)  # through which its labels want the command [s]
        self._blend = 1.0 - np.exp(-2 * np.pi * CUTOFF * model.step)
        self._predicted = 6 if torque == "predict" else 3  # channels of chi
        self._C = model.system.C.copy()
        self._C[self._predicted :] = 0.0
        self._lifting = _lifting_of(model)
        # Constants by stride, computed when first asked for
        self._resampled_offline: dict[int, LiftedLinearSystem] = {}

    @classmethod
    def load(cls, path: str | Path) -> "NeuralPredictor":
        """Return the predictor of a model file.

        Raises: ValueError: one line, on a bad file.
        """
        return cls(load_model(path))

    def initial_memory(self) -> Memory:
        """Return the memory before any sample, whose forecast is zero."""
        scalars = {name: np.zeros(1) for name in ("count", "labels", "dropped", "gap")}
        window = np.zeros((self.model.window, 12))
        memory = {"window": window, "z": np.zeros(self.model.system.K), "lowpass": np.zeros(6)}
        return memory | scalars | self._lifting.initial_memory()

    def update(self, memory: Memory, sample: Sample) -> Memory:
        """Return the memory after one more sample; see the class for samples with NaN."""
        label, zeta = np.asarray(sample.chi, float), rigid_body.zeta(np.asarray(sample.x, float))
        labelled, seen = bool(np.isfinite(label).all()), bool(np.isfinite(zeta).all())
        new = {**memory, **self._counted(memory, labelled, labelled and seen)}
        if labelled:
            blend = max(self._blend, 1.0 / new["labels"][0])
            new["lowpass"] = memory["lowpass"] + blend * (label - memory["lowpass"])
        if new["count"][0] == 0:
            return new if self.model.trust is None else new | self.model.trust.initial_memory()
        chi = label if labelled else self._own_prediction(memory)
        row = np.concatenate([chi, zeta if seen else memory["window"][-1, 6:]])
        new["window"] = np.concatenate([memory["window"][1:], row[None]])
        return new | self._lifting.update(new, warm=self._warm(new), labelled=labelled)

    def forecast(self, memory: Memory, *, horizon: int, stride: int) -> WrenchForecast:
        """Return the forecast from the lifted state.

        Torque (unless predicted), and everything before the window is full, is held in `offset`.
        """
        offset, system, z = memory["lowpass"].copy(), self._resampled(memory, stride), memory["z"]
        if self._warm(memory):
            offset[: self._predicted] = 0.0
        else:
            system, z = dc.replace(system, B=np.zeros_like(system.B)), np.zeros_like(z)
        return WrenchForecast(system.A, system.B, self._C, z, np.tile(offset, (horizon, 1)))

    def system(self, memory: Memory) -> LiftedLinearSystem:
        """Return the lifted linear system in use now, at the model's step."""
        s = self.model.system
        return LiftedLinearSystem(memory["A"], memory["B"], s.C, s.step) if "A" in memory else s

    def _counted(self, memory: Memory, labelled: bool, complete: bool) -> Memory:
        """Return the counters after one more sample."""
        W = self.model.window
        gap = np.zeros(1) if complete else memory["gap"] + 1.0
        lost = gap[0] >= W or (not complete and memory["count"][0] == 0)
        return {
            "gap": gap,
            "count": np.zeros(1) if lost else np.minimum(memory["count"] + 1.0, W),
            "labels": memory["labels"] + float(labelled),
            "dropped": memory["dropped"] + float(not complete),
        }

    def _warm(self, memory: Memory) -> bool:
        """Return whether there are samples enough for a forecast."""
        return bool(memory["count"][0] >= self.model.window)

    def _own_prediction(self, memory: Memory) -> np.ndarray:
        """Return what the model expected for this sample before it came, (6,)."""
        if not self._warm(memory):
            return memory["lowpass"]
        s, window, encoder = self.system(memory), memory["window"], self.model.encoder
        z = encoder(window[-1, :6]) if isinstance(encoder, Phi) else memory["z"]
        return s.C @ (s.A @ z + s.B @ window[-1 - self.model.late, 6:])

    def _resampled(self, memory: Memory, stride: int) -> LiftedLinearSystem:
        if "A" in memory:
            return self.system(memory).resample(stride)
        if stride not in self._resampled_offline:
            self._resampled_offline[stride] = self.model.system.resample(stride)
        return self._resampled_offline[stride]


class _Windowed:
    """Linear encoder of the window, its forecast corrected by a trust where the model has one."""

    def __init__(self, model: LiftedModel, encoder: DelayEncoder):
        self.model, self._encoder = model, encoder

    def initial_memory(self) -> Memory:
        """Return what is kept beside the predictor's own memory."""
        return {} if self.model.trust is None else self.model.trust.initial_memory()

    def update(self, memory: Memory, *, warm: bool, labelled: bool) -> Memory:
        """Return z, once `warm`, and what else changes with the newest sample of the window."""
        z = self._encoder(memory["window"]) if warm else None
        if self.model.trust is None:
            return {} if z is None else {"z": z}
        return self.model.trust.update(memory, z, memory["window"][-1, :6], labelled=labelled)


class WindowRefit:
    """Phi of one label, with A and B refit on the window: Bayesian regression about the offline
    matrices A_0 and B_0, projected stable.

    The window is Y = X Theta + E with rows [z, zeta / scale] in X, the next z in Y, Theta = [A B]'.
    The prior is matrix normal, Theta ~ N(Theta_0, Sigma / p), with the covariance Sigma across z
    that the noise E has. So the mean is

        Theta = Theta_0 + (X'X + p)^-1 X'(Y - X Theta_0).

    p, the model's `ridge`, is learned from the training flights (`most_likely_ridge`). Directions
    that the window does not excite stay at the prior: forty samples cannot determine thirty columns
    (median rank 15 on real flights). Each label stands beside the zeta of its own time, `late`
    samples before it.
    Source: Jin et al. 2025, Algorithm 1; the prior is an own choice.
    """

    def __init__(self, model: LiftedModel):
        if not isinstance(model.encoder, Phi):
            raise ValueError(
                "WindowRefit: the encoder must be Phi; a delay encoder flies with its offline A, B."
            )
        require(model.ridge > 0, f"WindowRefit: ridge must be positive; got {model.ridge}.")
        self.model, self.phi = model, model.encoder
        self._scale = model.zeta_scale
        self._pull = model.ridge * np.hstack([model.system.A, model.system.B * self._scale])

    def initial_memory(self) -> Memory:
        """Return A, B, and the window as the refit reads it."""
        s = self.model.system
        rows = np.zeros((self.model.window - self.model.late, s.K + 6))
        return {"A": s.A, "B": s.B, "rows": rows}

    def update(self, memory: Memory, *, warm: bool, labelled: bool) -> Memory:
        """Return the rows with the newest sample; of a full window also z, A and B."""
        window = memory["window"]
        newest = self.rows(window[-1 - self.model.late :])
        rows = np.concatenate([memory["rows"][1:], newest])
        if not warm:
            return {"rows": rows}
        A, B = self.solve(rows)
        z = advance(rows[-1, :-6], A, B, self.model.since_label(window))
        return {"rows": rows, "z": z, "A": A, "B": B}

    def rows(self, samples: np.ndarray) -> np.ndarray:
        """Return the rows [z, zeta / scale] (n - late, K + 6) of the regression from samples [chi,
        zeta] (n, 12).
        """
        z = self.phi(samples[self.model.late :, :6])
        return np.concatenate([z, samples[: len(z), 6:] / self._scale], axis=-1)

    def solve(self, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return stable A (K, K) and B (K, 6) from the `rows` (W - late, K + 6) of a window.

        A flight keeps the rows, so that each sample is lifted once. The normal matrix is formed
        anew at every sample: one product of 2 us, which adding one row and removing one would not
        beat, and it accumulates no rounding error.
        """
        # (X'X + p) [A B]' = X'Y + p [A_0 B_0]', by Cholesky
        X, K = rows[:-1], self.phi.K
        normal = X.T @ X
        normal.flat[:: len(normal) + 1] += self.model.ridge
        moments = rows[1:, :K].T @ X + self._pull
        # Transposed: no copies
        solution = lapack.dposv(normal.T, moments.T, overwrite_a=1, overwrite_b=1)[1].T
        return stabilized(solution[:, :K], RADIUS), solution[:, K:] / self._scale


def _lifting_of(model: LiftedModel) -> _Windowed | WindowRefit:
    """Return how windows are lifted in flight."""
    if isinstance(model.encoder, DelayEncoder):
        return _Windowed(model, model.encoder)
    return WindowRefit(model)
