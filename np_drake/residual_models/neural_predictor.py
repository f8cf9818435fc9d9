"""A lifted linear system as a residual model, with a refit of its matrices in flight."""

import dataclasses as dc
from pathlib import Path

import numpy as np
from scipy.linalg import lapack

from np_drake import rigid_body
from np_drake.lifting.model.lifted_linear_system import (
    RADIUS,
    LiftedLinearSystem,
    advance,
    stabilized,
)
from np_drake.lifting.model.lifted_model import NEURAL_WINDOW, LiftedModel, load_model
from np_drake.residual_model import Memory, Sample, WrenchForecast
from np_drake.trained_model import delay_of, label_of, rotor_lag_of

CUTOFF = 4.0  # of the low-pass on held labels [Hz]


class NeuralPredictor:
    """Predictor z = Phi(window);  z+ = A z + B zeta;  chi_hat = C z.

    A label that is known to be late is lifted at its own time, and z then taken to the present with
    the zeta since.

    Memory: window (W, 12) of [chi, zeta], oldest first; z (K,); where A (K, K) and B (K, 6) change
    in flight, these, and rows (refit, K + 6), what the refit reads of each sample, lifted once,
    zero before the first window was full; lowpass (6,) of the labels; count of samples in the
    window, up to W; labels so far; gap: samples in a row just now without label or state; where the
    model has a `trust`, its memory, as trust/…. Until the window is full the forecast holds
    `lowpass`, and afterwards that of channels that C does not read. A missing label is filled with
    the model's own prediction, a missing state with the last zeta; after W samples in a row
    without, the window starts afresh.
    Source: Jin et al. 2025, eq. (nmpc).

    Args:
        model: of any configuration.
    """

    def __init__(self, model: LiftedModel):
        self.name = "np" if model.configuration == NEURAL_WINDOW else model.configuration
        self.model, self.step = model, model.step
        # What its labels are made with
        self.label = label_of(model)
        self.rotor_lag = rotor_lag_of(model)  # [s]
        self.delay = delay_of(model)  # of commands [s]
        self._blend = 1.0 - np.exp(-2 * np.pi * CUTOFF * model.step)
        self._held = ~model.system.C.any(axis=1)  # channels of chi
        self._refit = WindowRefit(model) if model.refit else None
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
        scalars = {name: np.zeros(1) for name in ("count", "labels", "gap")}
        window = np.zeros((self.model.window, 12))
        memory = {"window": window, "z": np.zeros(self.model.system.K), "lowpass": np.zeros(6)}
        return memory | scalars | self._afresh()

    def update(self, memory: Memory, sample: Sample) -> Memory:
        """Return the memory after one more sample; see the class for samples with NaN."""
        label, zeta = np.asarray(sample.chi, float), rigid_body.zeta(np.asarray(sample.x, float))
        labelled, seen = bool(np.isfinite(label).all()), bool(np.isfinite(zeta).all())
        new = {**memory, **self._counted(memory, labelled, labelled and seen)}
        if labelled:
            blend = max(self._blend, 1.0 / new["labels"][0])
            new["lowpass"] = memory["lowpass"] + blend * (label - memory["lowpass"])
        if new["count"][0] == 0:
            return new | self._afresh()
        chi = label if labelled else self._own_prediction(memory)
        row = np.concatenate([chi, zeta if seen else memory["window"][-1, 6:]])
        new["window"] = np.concatenate([memory["window"][1:], row[None]])
        return new | self._lifted(new, labelled=labelled)

    def forecast(self, memory: Memory, *, horizon: int, stride: int) -> WrenchForecast:
        """Return the forecast from the lifted state.

        Channels that C does not read, and all before the window is full, are held in `offset`.
        """
        offset, system, z = memory["lowpass"].copy(), self._resampled(memory, stride), memory["z"]
        if self._warm(memory):
            offset[~self._held] = 0.0
        else:
            system, z = dc.replace(system, B=np.zeros_like(system.B)), np.zeros_like(z)
        return WrenchForecast(system.A, system.B, system.C, z, np.tile(offset, (horizon, 1)))

    def system(self, memory: Memory) -> LiftedLinearSystem:
        """Return the lifted linear system in use now, at the model's step."""
        s = self.model.system
        return LiftedLinearSystem(memory["A"], memory["B"], s.C, s.step) if "A" in memory else s

    def _afresh(self) -> Memory:
        """Return what the refit and the trust start from."""
        memory = {} if self._refit is None else self._refit.initial_memory()
        return memory if self.model.trust is None else memory | self.model.trust.initial_memory()

    def _lifted(self, new: Memory, *, labelled: bool) -> Memory:
        """Return z, once the window is full, and what else changes with its newest sample."""
        model, window = self.model, new["window"]
        z = model.encoder(model.in_time(window)) if self._warm(new) else None
        if model.trust is not None:
            return model.trust.update(new, z, window[-1, :6], labelled=labelled)
        if z is None:
            return {}
        zeta = window[-1 - model.late, 6:]
        found = {} if self._refit is None else self._refit.update(new["rows"], z, zeta)
        system = self.system(new | found)
        return found | {"z": advance(z, system.A, system.B, model.since_label(window))}

    def _counted(self, memory: Memory, labelled: bool, complete: bool) -> Memory:
        """Return the counters after one more sample."""
        W = self.model.window
        gap = np.zeros(1) if complete else memory["gap"] + 1.0
        lost = gap[0] >= W or (not complete and memory["count"][0] == 0)
        return {
            "gap": gap,
            "count": np.zeros(1) if lost else np.minimum(memory["count"] + 1.0, W),
            "labels": memory["labels"] + float(labelled),
        }

    def _warm(self, memory: Memory) -> bool:
        """Return whether there are samples enough for a forecast."""
        return bool(memory["count"][0] >= self.model.window)

    def _own_prediction(self, memory: Memory) -> np.ndarray:
        """Return what the model expected for this sample before it came, (6,)."""
        if not self._warm(memory):
            return memory["lowpass"]
        s, zeta = self.system(memory), memory["window"][-1 - self.model.late, 6:]
        z = memory["rows"][-1, : s.K] if self._refit else memory["z"]  # at the time of the label
        return np.where(self._held, memory["lowpass"], s.C @ (s.A @ z + s.B @ zeta))

    def _resampled(self, memory: Memory, stride: int) -> LiftedLinearSystem:
        if "A" in memory:
            return self.system(memory).resample(stride)
        if stride not in self._resampled_offline:
            self._resampled_offline[stride] = self.model.system.resample(stride)
        return self._resampled_offline[stride]


class WindowRefit:
    """A and B refit on the last samples: Bayesian regression about the offline matrices A_0 and
    B_0, projected stable.

    The samples are Y = X Theta + E with rows [z, zeta / scale] in X, the next z in Y, Theta =
    [A B]'. The prior is matrix normal, Theta ~ N(Theta_0, Sigma / p), with the covariance Sigma
    across z that the noise E has. So the mean is

        Theta = Theta_0 + (X'X + p)^-1 X'(Y - X Theta_0).

    p is the model's `ridge`. Directions that the samples do not excite stay at the prior: forty
    cannot determine thirty columns (median rank 15 on real flights).
    Source: Jin et al. 2025, Algorithm 1; the prior is an own choice.
    """

    def __init__(self, model: LiftedModel):
        self._system, self._scale = model.system, model.zeta_scale
        self._count, self._ridge = model.refit, model.ridge
        self._pull = model.ridge * np.hstack([model.system.A, model.system.B * self._scale])

    def initial_memory(self) -> Memory:
        """Return A, B, and the samples as the refit reads them."""
        s = self._system
        return {"A": s.A, "B": s.B, "rows": np.zeros((self._count, s.K + 6))}

    def update(self, rows: np.ndarray, z: np.ndarray, zeta: np.ndarray) -> Memory:
        """Return the rows with one more sample, and A and B."""
        newest = np.concatenate([z, zeta / self._scale])
        rows = np.concatenate([rows[1:], newest[None]])
        A, B = self.solve(rows)
        return {"rows": rows, "A": A, "B": B}

    def solve(self, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return stable A (K, K) and B (K, 6) from `rows` (n, K + 6); rows of zeros say nothing.

        The normal matrix is formed anew at every sample: one product of 2 us, which adding one row
        and removing one would not beat, and it accumulates no rounding error.
        """
        # (X'X + p) [A B]' = X'Y + p [A_0 B_0]', by Cholesky
        X, K = rows[:-1], self._system.K
        normal = X.T @ X
        normal.flat[:: len(normal) + 1] += self._ridge
        moments = rows[1:, :K].T @ X + self._pull
        # Transposed: no copies
        solution = lapack.dposv(normal.T, moments.T, overwrite_a=1, overwrite_b=1)[1].T
        return stabilized(solution[:, :K], RADIUS), solution[:, K:] / self._scale
