"""The Neural Predictor as a residual model: one class, configurations by name."""

import dataclasses as dc
from pathlib import Path

import numpy as np

from np_drake import rigid_body
from np_drake.lifting.model.adaptive_family import EVERY, AdaptiveFamily
from np_drake.lifting.model.encoders import DelayEncoder, Phi
from np_drake.lifting.model.lifted_linear_system import LiftedLinearSystem, advance
from np_drake.lifting.model.lifted_model import FAMILIES, MODE_DICTIONARY, LiftedModel
from np_drake.lifting.model.model_file import load_model, rotor_lag_of
from np_drake.lifting.model.window_refit import WindowRefit
from np_drake.residual_model import FlightForecasts, Memory, Sample, WrenchForecast


@dc.dataclass(frozen=True)
class PredictorOptions:
    """Options of a trained model in flight."""

    torque: str = "hold"  # hold (last low-passed label) | predict
    cutoff: float = 4.0  # of the low-pass on held labels [Hz]
    refit: bool | None = None  # refit A, B on the window in flight; None: as the model asks


@dc.dataclass
class RefitForecasts(FlightForecasts):
    """Forecasts at every sample of a flight, each sample with its own A (o, K, K) and B (o, K,
    6).
    """

    before: (
        np.ndarray
    )  # (o,) spectral radius of each refit A before it was made stable, 0 of a family [1]

    def at(
        self, horizons: list[int], origins: np.ndarray, zeta: np.ndarray, *, zeta_known: bool
    ) -> np.ndarray:
        """Return chi_hat (o, len(horizons), 6) of the forecasts at `origins`, see `FlightForecasts`
        [N, N·m].
        """
        at = origins - self.first
        A, B, z = self.A[at].swapaxes(1, 2), self.B[at].swapaxes(1, 2), self.z[at][:, None]
        chi_hat = np.repeat(self.offset[at][:, None], len(horizons), axis=1)
        drive = zeta[origins][:, None] @ B
        for i in range(max(horizons) + 1):
            if i in horizons:
                chi_hat[:, horizons.index(i)] += (z @ self.C.T)[:, 0]
            if zeta_known and i > 0:
                drive = zeta[origins + i][:, None] @ B
            z = z @ A + drive
        return chi_hat


class NeuralPredictor:
    """Neural Predictor, z = Phi(chi) or E window;  z+ = A z + B zeta;  chi_hat = C z.

    A label that is known to be late is lifted at its own time, and z then taken to the present with
    the zeta since.

    Memory: window (W, 12) of [chi, zeta], oldest first; z (K,); where A (K, K) and B (K, 6) change
    in flight, these; of a refit rows (W - late, K + 6), the window as it reads it, so that every
    sample is lifted once; of a family theta (r,) and its covariance (r, r), its recursive estimate;
    lowpass (6,) of the labels; count of samples in the window, up to W; labels, dropped: samples
    with and without one so far; gap: dropped in a row just now; where the model has a `trust`, its
    memory, as trust/…. Until `count` reaches the model's `warm_up` the forecast holds `lowpass`. A
    missing label is filled with the model's own prediction, a missing state with the last zeta;
    after W samples in a row without, the window starts afresh.
    Source: Jin et al. 2025, eq. (nmpc).

    Args:
        model: of any configuration.
        options: of its flight.
    """

    def __init__(self, model: LiftedModel, options: PredictorOptions = PredictorOptions()):
        if options.torque not in ("hold", "predict"):
            raise ValueError(
                f"NeuralPredictor: torque must be hold | predict; got {options.torque}."
            )
        if options.torque == "predict" and not model.predicts_torque:
            raise ValueError(
                "NeuralPredictor: this model must not predict torque; it was trained "
                "without. Use hold."
            )
        self.name = (
            "np"
            if model.configuration in (*FAMILIES, MODE_DICTIONARY)
            else f"np-{model.configuration}"
        )
        self.step = model.step
        self.model, self.options = model, options
        self.rotor_lag = rotor_lag_of(model)  # through which its labels want the command [s]
        self._blend = 1.0 - np.exp(-2 * np.pi * options.cutoff * model.step)
        self._C = model.system.C.copy()
        if options.torque == "hold":
            self._C[3:] = 0.0
        refit = model.refits if options.refit is None else options.refit
        self._refit = WindowRefit(model) if refit else None
        self._family = model.encoder if isinstance(model.encoder, AdaptiveFamily) else None
        # Constants by stride, computed when first asked for
        self._resampled_offline: dict[int, LiftedLinearSystem] = {}

    @classmethod
    def load(
        cls, path: str | Path, options: PredictorOptions = PredictorOptions()
    ) -> "NeuralPredictor":
        """Return the predictor of a model file.

        Args:
            path: of the model file.
            options: of its flight.
        Raises: ValueError: one line, on a bad file.
        """
        return cls(load_model(path), options)

    def initial_memory(self) -> Memory:
        """Return the memory before any sample, whose forecast is zero."""
        s = self.model.system
        scalars = {name: np.zeros(1) for name in ("count", "labels", "dropped", "gap")}
        window = np.zeros((self.model.window, 12))
        memory = {"window": window, "z": np.zeros(s.K), "lowpass": np.zeros(6), **scalars}
        rows = np.zeros((self.model.window - self.model.late, s.K + 6))
        refit = {} if self._refit is None else {"A": s.A, "B": s.B, "rows": rows}
        family = self._family
        adapted = {}
        if family is not None:
            adapted = {
                "A": s.A,
                "B": s.B,
                "theta": family.mean.copy(),
                "covariance": family.covariance.copy(),
            }
        return memory | refit | adapted | self._fresh_trust()

    def update(self, memory: Memory, sample: Sample) -> Memory:
        """Return the memory after one more sample; see the class for samples with NaN."""
        label, zeta = np.asarray(sample.chi, float), rigid_body.zeta(np.asarray(sample.x, float))
        labelled, seen = bool(np.isfinite(label).all()), bool(np.isfinite(zeta).all())
        new = {**memory, **self._counted(memory, labelled, labelled and seen)}
        if labelled:
            blend = max(self._blend, 1.0 / new["labels"][0])
            new["lowpass"] = memory["lowpass"] + blend * (label - memory["lowpass"])
        if new["count"][0] == 0:
            return new | self._fresh_trust()
        chi = label if labelled else self._own_prediction(memory)
        row = np.concatenate([chi, zeta if seen else memory["window"][-1, 6:]])
        new["window"] = np.concatenate([memory["window"][1:], row[None]])
        warm = self._warm(new)
        if self._refit is not None:
            return new | self._refitted(memory["rows"], new["window"], warm)
        if warm:
            new |= self._lifted(new, labelled)
        elif self.model.trust is not None and labelled:
            new |= _named(self.model.trust.observe(_trust_of(new), chi))
        return new

    def along(self, chi: np.ndarray, zeta: np.ndarray) -> FlightForecasts | None:
        """Return the forecasts from `warm_up` samples on, equal to those of `update` sample by
        sample; None before.

        Args:
            chi: (n, 6) [N, N·m].
            zeta: (n, 6) [m/s, rad/s], without gaps.
        """
        first, s, samples = self.model.warm_up - 1, self.model.system, np.hstack([chi, zeta])
        A, B, before = s.A, s.B, None
        if len(chi) <= first:
            return None
        if self._family is not None:
            A, B, z = self._family.along(samples, self.step)
            before = np.zeros(len(z))
        elif isinstance(self.model.encoder, DelayEncoder):
            z = self.model.encoder.along(samples)
        else:
            if self._refit is not None:
                A, B, before = self._refit.along(samples, self.model.window)
            since = np.arange(first, len(chi))[:, None] - np.arange(self.model.late, 0, -1)
            assert isinstance(self.model.encoder, Phi)
            z = advance(self.model.encoder(chi[first:]), A, B, zeta[since])
        if self.model.trust is not None:
            z = self.model.trust.along(z, chi, first)
        offset = np.zeros((len(z), 6))
        if self.options.torque == "hold":
            offset[:, 3:] = self._lowpassed(chi)[first:, 3:]
        if before is None:
            return FlightForecasts(first, A, B, self._C, z, offset)
        return RefitForecasts(first, A, B, self._C, z, offset, before)

    def forecast(self, memory: Memory, *, horizon: int, stride: int) -> WrenchForecast:
        """Return the forecast from the lifted state.

        Torque (unless predicted), and everything before `warm_up`, is held in `offset`.
        """
        warm = self._warm(memory)
        offset = memory["lowpass"].copy()
        if warm:
            offset[: 6 if self.options.torque == "predict" else 3] = 0.0
        system = self._resampled(memory, stride)
        B = system.B if warm else np.zeros_like(system.B)
        z = memory["z"] if warm else np.zeros_like(memory["z"])
        return WrenchForecast(system.A, B, self._C, z, np.tile(offset, (horizon, 1)))

    def chi_hat(self, memory: Memory) -> np.ndarray:
        """Return the wrench now, as the forecast begins, (6,) [N, N·m]."""
        return self.forecast(memory, horizon=1, stride=1).rollout(np.zeros((1, 6)))[0]

    def _lowpassed(self, chi: np.ndarray) -> np.ndarray:
        """Return the low-passed labels of a flight without gaps, (n, 6)."""
        course, held = np.empty_like(chi), np.zeros(6)
        for k, label in enumerate(chi):
            held = held + max(self._blend, 1.0 / (k + 1)) * (label - held)
            course[k] = held
        return course

    def _counted(self, memory: Memory, labelled: bool, complete: bool) -> Memory:
        """Return the counters after one more sample."""
        W = self.model.window
        gap = np.zeros(1) if complete else memory["gap"] + 1.0
        lost = gap[0] >= W or (not complete and memory["count"][0] == 0)
        count = np.zeros(1) if lost else np.minimum(memory["count"] + 1.0, W)
        labels, dropped = (
            memory["labels"] + float(labelled),
            memory["dropped"] + float(not complete),
        )
        return {"gap": gap, "count": count, "labels": labels, "dropped": dropped}

    def _fresh_trust(self) -> Memory:
        return {} if self.model.trust is None else _named(self.model.trust.initial_memory())

    def _warm(self, memory: Memory) -> bool:
        """Return whether there are samples enough for a forecast."""
        return bool(memory["count"][0] >= self.model.warm_up)

    def _refitted(self, rows: np.ndarray, window: np.ndarray, full: bool) -> Memory:
        """Return the rows with the newest sample of the window (W, 12); of a full window also z, A
        and B.
        """
        assert self._refit is not None
        rows = np.concatenate([rows[1:], self._refit.rows(window[-1 - self.model.late :])])
        if not full:
            return {"rows": rows}
        A, B = self._refit.solve(rows)
        return {
            "rows": rows,
            "z": advance(rows[-1, :-6], A, B, self.model.since_label(window)),
            "A": A,
            "B": B,
        }

    def _lifted(self, memory: Memory, labelled: bool) -> Memory:
        """Return z, and the memory of the trust; of a family also theta and its covariance, where
        they change.
        """
        if self._family is not None:
            found: Memory = {}
            theta = memory["theta"]
            full = memory["count"][0] == self.model.window
            if full and labelled and memory["labels"][0] % EVERY == 0:
                theta, covariance = self._family.update(
                    theta, memory["covariance"], memory["window"], self.step
                )
                found = {"theta": theta, "covariance": covariance}
            at, z = self._family.read(memory["window"], theta)
            if at is not memory["theta"]:  # newly estimated, or corrected by the network
                s = self._family.system(at, self.step)
                found |= {"A": s.A, "B": s.B}
            return {"z": z, **found}
        z, chi = self.model.lift(memory["window"]), memory["window"][-1, :6]
        if self.model.trust is None:
            return {"z": z}
        kept = _trust_of(memory)
        if labelled:
            kept = self.model.trust.observe(kept, chi)
        kept, z = self.model.trust.correct(kept, z, chi)
        return {"z": z, **_named(kept)}

    def _own_prediction(self, memory: Memory) -> np.ndarray:
        """Return what the model expected for this sample before it came, (6,)."""
        if not self._warm(memory):
            return memory["lowpass"]
        s, window, encoder = self.system(memory), memory["window"], self.model.encoder
        z = encoder(window[-1, :6]) if isinstance(encoder, Phi) else memory["z"]
        chi = s.C @ (s.A @ z + s.B @ window[-1 - self.model.late, 6:])
        if not self.model.predicts_torque:
            chi[3:] = memory["lowpass"][3:]
        return chi

    def system(self, memory: Memory) -> LiftedLinearSystem:
        """Return the lifted linear system in use now, at the model's step."""
        s = self.model.system
        return LiftedLinearSystem(memory["A"], memory["B"], s.C, s.step) if "A" in memory else s

    def _resampled(self, memory: Memory, stride: int) -> LiftedLinearSystem:
        s = self.model.system
        if "A" in memory:
            return self.system(memory).resample(stride)
        if stride not in self._resampled_offline:
            self._resampled_offline[stride] = s.resample(stride)
        return self._resampled_offline[stride]


def _named(memory: Memory) -> Memory:
    """Return the memory of a trust under its names in the predictor's memory."""
    return {f"trust/{name}": value for name, value in memory.items()}


def _trust_of(memory: Memory) -> Memory:
    """Return the memory of the trust under its own names, the inverse of `_named`."""
    return {
        name.removeprefix("trust/"): value
        for name, value in memory.items()
        if name.startswith("trust/")
    }
