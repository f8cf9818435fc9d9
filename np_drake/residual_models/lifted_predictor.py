"""A lifted linear system as a residual model, with a refit of its matrices in flight."""

import dataclasses as dc
from abc import ABC, abstractmethod
from typing import Any

import numpy as np
from scipy.linalg import lapack

from np_drake import rigid_body
from np_drake.lifting.model.lifted_linear_system import RADIUS, LiftedLinearSystem, stabilized
from np_drake.lifting.model.lifted_model import LiftedModel
from np_drake.lifting.model.lpv_model import DECAYS, NEW, PARAMETERS, Features, K, LpvModel
from np_drake.residual_model import Memory, Sample, WrenchForecast
from np_drake.trained_model import delay_of, label_of, rotor_lag_of

CUTOFF = 4.0  # of the low-pass on held labels [Hz]


class LiftedLinearPredictor(ABC):
    """Predictor z = Phi(window);  z+ = A z + B zeta;  chi_hat = C z, whatever Phi, A and B are.

    Memory: window (W, 12) of [chi, zeta], oldest first; z (K,); lowpass (6,) of the labels; count
    of samples since it began; labels so far; gap: samples in a row just now without label or state;
    and what a subclass adds. The forecast holds `lowpass` before the first z, and afterwards that
    of channels that C does not read. A missing label is filled with the model's own prediction, a
    missing state with the last zeta; after W samples in a row without, the window starts afresh.
    Source: Jin et al. 2025, eq. (nmpc).

    Args:
        model: in a file with the low-pass, rotor lag and delay of its labels.
        unread: (6,) channels of chi that C does not read.
        enough: samples from which the first z is made.
        longest: samples beyond which `count` stays.
    """

    def __init__(
        self, model: LiftedModel | LpvModel, unread: np.ndarray, enough: int, longest: int
    ):
        self.model: Any = model
        self.name = model.configuration
        self.step = model.step
        # What its labels are made with
        self.label = label_of(model)
        self.rotor_lag = rotor_lag_of(model)  # [s]
        self.delay = delay_of(model)  # of commands [s]
        self._blend = 1.0 - np.exp(-2 * np.pi * CUTOFF * model.step)
        self._unread = unread
        self._enough = enough
        self._longest = longest

    @staticmethod
    def of(model: LiftedModel | LpvModel) -> "LiftedLinearPredictor":
        """Return the predictor of a model of any configuration."""
        return LpvPredictor(model) if isinstance(model, LpvModel) else LiftedPredictor(model)

    def initial_memory(self) -> Memory:
        """Return the memory before any sample, whose forecast is zero."""
        scalars = {name: np.zeros(1) for name in ("count", "labels", "gap")}
        memory = {"window": np.zeros((self.model.window, 12)), "lowpass": np.zeros(6)}
        return memory | scalars | self._afresh()

    def update(self, memory: Memory, sample: Sample) -> Memory:
        """Return the memory after one more sample; see the class for samples with NaN."""
        label = np.asarray(sample.chi, float)
        zeta = rigid_body.zeta(np.asarray(sample.x, float))
        labelled = bool(np.isfinite(label).all())
        seen = bool(np.isfinite(zeta).all())
        new = {**memory, **self._counted(memory, labelled, labelled and seen)}
        if labelled:
            blend = max(self._blend, 1.0 / new["labels"][0])
            new["lowpass"] = memory["lowpass"] + blend * (label - memory["lowpass"])
        if new["count"][0] == 0:
            return new | self._afresh()
        chi = label if labelled else self._own_prediction(memory)
        row = np.concatenate([chi, zeta if seen else memory["window"][-1, 6:]])[None]
        before = (
            memory["window"][1:] if memory["count"][0] else np.repeat(row, self.model.window - 1, 0)
        )
        new["window"] = np.concatenate([before, row])
        return new | self._lifted(new, labelled=labelled)

    def forecast(self, memory: Memory, *, horizon: int, stride: int) -> WrenchForecast:
        """Return the forecast from the lifted state.

        Channels that C does not read, and all before the first z, are held in `offset`.
        """
        offset = memory["lowpass"].copy()
        z = memory["z"]
        system = self.system(memory).resample(stride)
        if self._warm(memory):
            offset[~self._unread] = 0.0
        else:
            system = dc.replace(system, B=np.zeros_like(system.B))
            z = np.zeros_like(z)
        return WrenchForecast(system.A, system.B, system.C, z, np.tile(offset, (horizon, 1)))

    @abstractmethod
    def system(self, memory: Memory) -> LiftedLinearSystem:
        """Return the lifted linear system in use now, at the model's step."""

    @abstractmethod
    def _afresh(self) -> Memory:
        """Return z and what else begins anew with the window."""

    @abstractmethod
    def _lifted(self, new: Memory, *, labelled: bool) -> Memory:
        """Return z, where there are samples enough, and what else changes with the newest one."""

    def _own_prediction(self, memory: Memory) -> np.ndarray:
        """Return what the model expected for this sample before it came, (6,)."""
        if not self._warm(memory):
            return memory["lowpass"]
        s = self.system(memory)
        zeta = memory["window"][-1, 6:]
        return np.where(self._unread, memory["lowpass"], s.C @ (s.A @ memory["z"] + s.B @ zeta))

    def _counted(self, memory: Memory, labelled: bool, complete: bool) -> Memory:
        """Return the counters after one more sample."""
        gap = np.zeros(1) if complete else memory["gap"] + 1.0
        lost = gap[0] >= self.model.window or (not complete and memory["count"][0] == 0)
        return {
            "gap": gap,
            "count": np.zeros(1) if lost else np.minimum(memory["count"] + 1.0, self._longest),
            "labels": memory["labels"] + float(labelled),
        }

    def _warm(self, memory: Memory) -> bool:
        """Return whether there are samples enough for a forecast."""
        return bool(memory["count"][0] >= self._enough)


class LiftedPredictor(LiftedLinearPredictor):
    """Predictor of one system, or of one that is refit in flight.

    Memory: as of `LiftedLinearPredictor`; where A (K, K) and B (K, 6) change in flight, these, and
    rows (refit, K + 6), what the refit reads of each sample, lifted once, zero before the first
    window was full; where the model has a `trust`, its memory, as trust/….

    Args:
        model: `paper` or `mode-dictionary`.
    """

    def __init__(self, model: LiftedModel):
        unread = np.all(model.system.C == 0.0, axis=1)
        super().__init__(model, unread, enough=model.window, longest=model.window)

    def system(self, memory: Memory) -> LiftedLinearSystem:
        """Return the lifted linear system in use now, at the model's step."""
        s = self.model.system
        return LiftedLinearSystem(memory["A"], memory["B"], s.C, s.step) if "A" in memory else s

    def _afresh(self) -> Memory:
        s = self.model.system
        memory = {"z": np.zeros(s.K)}
        if self.model.refit:
            memory |= {"A": s.A, "B": s.B, "rows": np.zeros((self.model.refit, s.K + 6))}
        return memory if self.model.trust is None else memory | self.model.trust.initial_memory()

    def _lifted(self, new: Memory, *, labelled: bool) -> Memory:
        model = self.model
        window = new["window"]
        z = model.encoder(window) if self._warm(new) else None
        if model.trust is not None:
            return model.trust.update(new, z, window[-1, :6], labelled=labelled)
        if z is None:
            return {}
        if not model.refit:
            return {"z": z}
        sample = np.concatenate([z, window[-1, 6:] / model.zeta_scale])
        rows = np.vstack([new["rows"][1:], sample])
        A, B = window_refit(model, rows)
        return {"z": z, "A": A, "B": B, "rows": rows}


class LpvPredictor(LiftedLinearPredictor):
    """Predictor whose A, B and C a network writes at every sample.

    Memory: as of `LiftedLinearPredictor`, the window of 100 samples, before it is full the first
    one in the place of those that lack; theta, what the network wrote at the last label; energy
    (2, P + 2), decaying means that it reads. Without a label z moves on by the system of theta.
    """

    def __init__(self, model: LpvModel):
        super().__init__(model, np.arange(6) == 5, enough=1, longest=int(10 * NEW))
        self.name = "np"

    def system(self, memory: Memory) -> LiftedLinearSystem:
        """Return the lifted linear system in use now, at the model's step."""
        return self.model.system(memory["theta"])

    def _afresh(self) -> Memory:
        return {
            "z": np.zeros(K),
            "theta": np.zeros(PARAMETERS),
            "energy": np.zeros((len(DECAYS), self.model.probes.shape[1] + 2)),
        }

    def _lifted(self, new: Memory, *, labelled: bool) -> Memory:
        window = new["window"] / self.model.scale
        features = Features.of(window)
        decay = DECAYS[:, None]
        energy = decay * new["energy"] + (1 - decay) * self.model.energies(features)
        if not labelled:  # a network that reads its own predictions may run away
            s = self.model.system(new["theta"])
            return {"z": s.A @ new["z"] + s.B @ new["window"][-2, 6:], "energy": energy}
        mean = energy / (1 - decay ** new["count"])
        age = np.minimum(new["count"], NEW) / NEW
        states, theta = self.model.schedule(features.planes, features.heave, mean, age)
        z = np.concatenate([states, window[-2, 6:9]])
        return {"z": z, "theta": theta, "energy": energy}


def window_refit(model: LiftedModel, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return stable A (K, K) and B (K, 6), refit on the last samples `rows` (n, K + 6), of which
    zeros say nothing: Bayesian regression about the offline matrices A_0 and B_0.

    The samples are Y = X Theta + E with rows [z, zeta / scale] in X, the next z in Y, Theta =
    [A B]'. The prior is matrix normal, Theta ~ N(Theta_0, Sigma / p), with the covariance Sigma
    across z that the noise E has. So the mean is

        Theta = Theta_0 + (X'X + p)^-1 X'(Y - X Theta_0).

    p is the model's `ridge`. Directions that the samples do not excite stay at the prior: forty
    cannot determine thirty columns (median rank 15 on real flights). The normal matrix is formed
    anew at every sample: one product of 2 us, which adding one row and removing one would not beat,
    and it accumulates no rounding error.
    Source: Jin et al. 2025, Algorithm 1; the prior is an own choice.
    """
    # (X'X + p) [A B]' = X'Y + p [A_0 B_0]', by Cholesky
    X = rows[:-1]
    K = model.system.K
    scale = model.zeta_scale
    normal = X.T @ X
    normal.flat[:: len(normal) + 1] += model.ridge
    offline = np.hstack([model.system.A, model.system.B * scale])
    moments = rows[1:, :K].T @ X + model.ridge * offline
    # Transposed: no copies
    solution = lapack.dposv(normal.T, moments.T, overwrite_a=1, overwrite_b=1)[1].T
    return stabilized(solution[:, :K], RADIUS), solution[:, K:] / scale
