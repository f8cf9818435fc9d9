"""Bound on the error of the lifted prediction (Theorem 1), computed before the error is seen, and
its check on a flight.

E_n = z_n - z_hat_n with z_hat_0 = z_0, z_hat_(i+1) = A z_hat_i + B zeta_i and the A, B that fly.
All in scaled coordinates: |chi_(k+j) - chi_k| / chi_scale is at most the allowed change of chi over
j steps, and so for zeta.
Source: Jin et al. 2025, Theorem 1, corrected; derivation and proof in docs/studies/error-bound.md.
"""

import dataclasses as dc

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from np_drake.lifting.model.adaptive_family import AdaptiveFamily
from np_drake.lifting.model.encoders import Phi
from np_drake.lifting.model.lifted_linear_system import LiftedLinearSystem
from np_drake.lifting.model.lifted_model import LiftedModel
from np_drake.lifting.model.window_refit import WindowRefit

HORIZON = 40  # steps [1]
ROUNDING = 1e-9  # relative excess that floating point may cause [1]
RESOLUTION = 1e-9  # of z and of chi / scale; smaller errors are rounding and have no ratio [1]
ASSUMPTIONS = ("Lipschitz constant", "stability")  # beside the premise on steps of chi and zeta
KINDS = ("z", "chi")  # of bounds: on |E_n|, and on |chi_n - C z_hat_n| over scale


@dc.dataclass(frozen=True)
class BoundCheck:
    """Result of checking the bound on all windows of one flight."""

    windows: int  # how many [1]
    holds: float  # share of all windows in which every bound holds at every n [1]
    premise: float  # share in which chi and zeta then changed no more than was allowed [1]
    holds_on_premise: float  # share of `holds` among these, NaN without any [1]
    ratio: dict[str, np.ndarray]  # kind -> (windows, N) bound / error [1]
    c: np.ndarray  # (windows,) bound on the first local error |z_1 - A z_0 - B zeta_0|
    residual: np.ndarray  # (windows,) |z_0 - A z_-1 - B zeta_-1| of the window's own fit
    violated: dict[str, float]  # assumption -> share of the windows in which it failed [1]
    spectral_radius: float  # largest over the windows [1]
    lipschitz: float  # of the encoder in scaled coordinates, of chi (Phi) or of the window [1]
    alpha_chi: float  # allowed change over one step, scaled [1]
    alpha_zeta: float  # allowed change over one step, scaled [1]

    def tightness(self, kind: str, n: int) -> tuple[float, float]:
        """Return the median and 95th percentile of bound / error n = 1 … N steps ahead [1]."""
        median, high = np.nanquantile(self.ratio[kind][:, n - 1], [0.5, 0.95])
        return float(median), float(high)


def check_flight(
    model: LiftedModel,
    chi: np.ndarray,
    zeta: np.ndarray,
    *,
    alpha: tuple[np.ndarray, np.ndarray] | None = None,
    horizon: int = HORIZON,
    spacing: int = 1,
) -> BoundCheck:
    """Compute bounds and errors after every `spacing`-th sample of one uninterrupted flight.

    Args:
        chi, zeta: (n, 6) labels [N, N·m] and motion [m/s, rad/s].
        alpha: (horizon,) changes of chi and of zeta that are allowed over 1, 2, … steps, scaled;
            None for the flight's own largest ones, under which the premise holds.
    Raises: ValueError: if the flight is too short for one window, or theta changes in flight.
    """
    allowed = largest_changes(model, chi, zeta, horizon) if alpha is None else alpha
    dut = _Theorem(model, allowed, horizon)
    samples = np.hstack([chi, zeta])
    origins = np.arange(dut.samples - 1, len(samples) - horizon, spacing)
    if len(origins) == 0:
        raise ValueError(
            f"bound: at least {dut.samples + horizon} samples are needed; got {len(samples)}."
        )
    found = [dut.checked(samples[k - dut.samples + 1 : k + horizon + 1]) for k in origins]
    bounds, errors = (np.stack([one[part] for one in found]) for part in ("bounds", "errors"))
    holds = np.all(errors <= bounds * (1 + ROUNDING) + RESOLUTION, axis=(1, 2))
    ratio = np.divide(bounds, errors, out=np.full_like(bounds, np.nan), where=errors > RESOLUTION)
    premise = _premise(model, allowed, samples, origins)
    broken = {
        name: float(np.mean([name in one["violated"] for one in found])) for name in ASSUMPTIONS
    }
    return BoundCheck(
        windows=len(origins),
        holds=float(holds.mean()),
        premise=float(premise.mean()),
        holds_on_premise=float(holds[premise].mean()) if premise.any() else np.nan,
        ratio={kind: ratio[:, i] for i, kind in enumerate(KINDS)},
        c=np.array([one["c"] for one in found]),
        residual=np.array([one["residual"] for one in found]),
        violated={name: share for name, share in broken.items() if share > 0},
        spectral_radius=max(one["radius"] for one in found),
        lipschitz=dut.lipschitz,
        alpha_chi=float(allowed[0][0]),
        alpha_zeta=float(allowed[1][0]),
    )


def largest_changes(
    model: LiftedModel, chi: np.ndarray, zeta: np.ndarray, horizon: int = HORIZON
) -> tuple[np.ndarray, np.ndarray]:
    """Return the largest scaled changes of chi and zeta of a flight over 1, 2, … steps, (horizon,)
    each [1].
    """
    scaled = chi / _chi_scale(model), zeta / model.zeta_scale
    lags = range(1, horizon + 1)
    chi_alpha, zeta_alpha = (
        np.array([_sizes(values[j:] - values[:-j]).max(initial=0.0) for j in lags])
        for values in scaled
    )
    return chi_alpha, zeta_alpha


class _Theorem:
    """Error bound of one model under allowed changes; what all windows share is computed once.

    radius: (N,) bound on the distance of z_n from where it would be if chi and zeta stood still
    from now on.   travel: (N,) bound on the distance of z_(k+n) from z_k.
    """

    def __init__(self, model: LiftedModel, alpha, horizon: int):
        if isinstance(model.encoder, AdaptiveFamily) and len(model.encoder.mean):
            raise ValueError(
                "bound: A, B and encoder must not change with theta. Train on one flight, "
                "--envelope 0."
            )
        # A forecast from the time of the label: a late one is not taken to the present
        self.model, self.horizon = dc.replace(model, late=0), horizon
        self._chi, self._zeta = alpha
        self._scale = _chi_scale(model)
        self._rows = slice(6 if model.predicts_torque else 3)
        self.lipschitz, self._radius, self._travel = self._reach()
        # A delay encoder needs one sample more than it sees, for the residual
        self.samples = model.window + (0 if isinstance(model.encoder, Phi) else 1)
        self._refit = WindowRefit(model) if isinstance(model.encoder, Phi) else None
        self._offline = None if self._refit else self._norms(model.system)

    def checked(self, samples: np.ndarray) -> dict:
        """Return bounds and errors (kinds, N) after the window of the first `samples` rows of
        [chi, zeta] (samples + N, 12), and what was found of c, residual and assumptions.
        """
        window, N = samples[: self.samples], self.horizon
        system = self.model.system
        if self._refit is not None:
            A, B = self._refit.solve(self._refit.rows(window))
            system = dc.replace(system, A=A, B=B)
        A_norms, B_norms, CB_norms = self._offline or self._norms(system)
        z = self.model.lift(window[-self.model.window :])
        before = self.model.lift(window[-self.model.window - 1 : -1])
        residual = np.linalg.norm(z - system.A @ before - system.B @ window[-2, 6:])
        local = residual + (1.0 + A_norms[1]) * self._travel + B_norms[0] * self._zeta
        held = _rolled(system, z, np.tile(window[-1, 6:], (N, 1)))
        z_held = _sizes(self._standing_still(window) - held) + self._radius
        chi_held = self._off(window[-1, :6], held, system) + self._chi
        moved = np.concatenate([[0.0], self._zeta])  # zeta that the rollout does not know
        operator = np.convolve(A_norms[:N], local)[:N]
        bounds = (
            np.minimum(operator, z_held + np.convolve(B_norms, moved)[:N]),
            chi_held + np.convolve(CB_norms, moved)[:N],
        )
        last = self.samples - 1
        flown = _rolled(system, z, samples[last : last + N, 6:])
        true = self._lift_all(samples[self.samples - self.model.window + 1 :])
        errors = (_sizes(true - flown), self._off(samples[last + 1 :, :6], flown, system))
        radius = system.spectral_radius
        kept = (
            self.lipschitz <= self.model.summary.get("gamma", np.inf) * (1 + ROUNDING),
            radius < 1.0,
        )
        return {
            "bounds": np.stack(bounds),
            "errors": np.stack(errors),
            "c": local[0],
            "residual": residual,
            "radius": radius,
            "violated": [name for name, held in zip(ASSUMPTIONS, kept, strict=True) if not held],
        }

    def _reach(self) -> tuple[float, np.ndarray, np.ndarray]:
        """Return the Lipschitz constant, radius and travel of the encoder.

        Phi: L |dchi|, L the product of the layers' spectral norms. Delay encoder: sum over lags d
        of |E_d| |dx|, where the sample at lag d has moved for n - d steps only since now.
        """
        model, N = self.model, self.horizon
        if isinstance(model.encoder, Phi):
            L = model.encoder.lipschitz_bound
            return L, L * self._chi, L * self._chi
        encoder = model.linear_encoder
        E = encoder.E.reshape(encoder.K, encoder.delay, 12).swapaxes(0, 1)[::-1]  # by lag
        of_chi = _spectral_norms(E[..., :6] * model.chi_scale)
        of_zeta = _spectral_norms(E[..., 6:] * model.zeta_scale)
        radius = np.convolve(of_chi, self._chi)[:N] + np.convolve(of_zeta, self._zeta)[:N]
        travel = of_chi.sum() * self._chi + of_zeta.sum() * self._zeta
        scales = np.tile(np.concatenate([model.chi_scale, model.zeta_scale]), encoder.delay)
        return float(_spectral_norms(encoder.E * scales)), radius, travel

    def _norms(self, system: LiftedLinearSystem) -> list[np.ndarray]:
        """Return |A^i|, |A^i B S_zeta| and |S_chi^-1 C A^i B S_zeta|, i = 0 … N-1."""
        A = _powers(system.A, np.eye(system.K), max(self.horizon, 2))
        B = _powers(system.A, system.B * self.model.zeta_scale, self.horizon)
        CB = ((system.C / self._scale[:, None]) @ B)[:, self._rows]
        return [_spectral_norms(M) for M in (A, B, CB)]

    def _lift_all(self, samples: np.ndarray) -> np.ndarray:
        """Return z (n - W + 1, K) of every full window of samples (n, 12)."""
        return self.model.lift(
            sliding_window_view(samples, self.model.window, axis=0).swapaxes(1, 2)
        )

    def _standing_still(self, window: np.ndarray) -> np.ndarray:
        """Return z_n (N, K), n = 1 …, if chi and zeta kept the values of the window's last row."""
        still = np.broadcast_to(window[-1], (self.horizon, 12))
        return self._lift_all(np.concatenate([window[-self.model.window :], still])[1:])

    def _off(self, chi: np.ndarray, z: np.ndarray, system: LiftedLinearSystem) -> np.ndarray:
        """Return |chi - C z| over scale, predicted channels, (N,)."""
        return _sizes(((chi - z @ system.C.T) / self._scale)[:, self._rows])


def _premise(model: LiftedModel, allowed, samples: np.ndarray, origins: np.ndarray) -> np.ndarray:
    """Return whether every change that the proof bounds was within what was allowed, (windows,)."""
    scaled = samples[:, :6] / _chi_scale(model), samples[:, 6:] / model.zeta_scale
    good = np.ones(len(samples), bool)
    for values, most in zip(scaled, allowed, strict=True):
        for j, limit in enumerate(most, start=1):
            good[:-j] &= _sizes(values[j:] - values[:-j]) <= limit * (1 + ROUNDING)
    # Samples from which the proof counts changes
    span = 2 if isinstance(model.encoder, Phi) else model.window + 1
    return sliding_window_view(good, span)[origins - span + 1].all(axis=1)


def _chi_scale(model: LiftedModel) -> np.ndarray:
    """Return the (6,) scale by which chi is divided before the encoder sees it [N, N·m]."""
    return model.encoder.scale if isinstance(model.encoder, Phi) else model.chi_scale


def _sizes(rows: np.ndarray) -> np.ndarray:
    return np.linalg.norm(rows, axis=1)


def _rolled(system: LiftedLinearSystem, z: np.ndarray, zeta: np.ndarray) -> np.ndarray:
    """Return z_hat_1 … z_hat_N (N, K) from z (K,) under zeta (N, 6)."""
    out = np.empty((len(zeta), len(z)))
    for i, moved in enumerate(zeta):
        out[i] = z = system.A @ z + system.B @ moved
    return out


def _spectral_norms(matrices: np.ndarray) -> np.ndarray:
    """Return the largest singular values (...,) of matrices (..., m, n), from the smaller Gram
    matrix.
    """
    M = matrices if matrices.shape[-2] >= matrices.shape[-1] else matrices.swapaxes(-1, -2)
    return np.sqrt(np.maximum(np.linalg.eigvalsh(M.swapaxes(-1, -2) @ M)[..., -1], 0.0))


def _powers(A: np.ndarray, first: np.ndarray, count: int) -> np.ndarray:
    """Return first, A first, A² first, …, stacked to (count, K, m)."""
    out = np.empty((count, *first.shape))
    for i in range(count):
        out[i] = first
        first = A @ first
    return out
