"""Check of the error bound on a flight: the bound after every window against the error that
followed.
"""

import dataclasses as dc

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from np_drake.lifting.bounds.encoder_reach import Change, chi_scale
from np_drake.lifting.bounds.error_bound import (
    ASSUMPTIONS,
    HORIZON,
    ROUNDING,
    Alpha,
    ErrorBound,
    TheoremBound,
    largest_changes,
)
from np_drake.lifting.model.encoders import Phi
from np_drake.lifting.model.lifted_model import LiftedModel

KINDS = ("z", "z_held", "operator", "chi", "chi_held")  # of bounds, as the fields of `ErrorBound`
CHUNK = 1000  # windows at a time, for memory [1]
RESOLUTION = 1e-9  # of z and of chi / scale; smaller errors are rounding and have no ratio [1]


@dc.dataclass(frozen=True)
class BoundCheck:
    """Result of checking the bound on all windows of one flight."""

    windows: int  # how many [1]
    holds: float  # share of all windows in which every bound holds at every n [1]
    premise: float  # share in which chi and zeta then changed no more than was allowed [1]
    holds_on_premise: float  # share of `holds` among these, NaN without any [1]
    ratio: dict[str, np.ndarray]  # kind -> (windows, N) bound / error [1]
    c: np.ndarray  # (windows,), see `ErrorBound`
    residual: np.ndarray  # (windows,), see `ErrorBound`
    violated: dict[str, float]  # name -> share of the windows in which that assumption failed [1]
    spectral_radius: float  # largest over the windows [1]
    lipschitz: float  # largest over the windows [1]
    alpha_chi: float  # allowed change over one step, scaled [1]
    alpha_zeta: float  # allowed change over one step, scaled [1]

    def tightness(self, kind: str, n: int) -> tuple[float, float]:
        """Return the median and 95th percentile of bound / error n steps ahead [1].

        Args:
            kind: one of `KINDS`.
            n: 1 … N.
        """
        median, high = np.nanquantile(self.ratio[kind][:, n - 1], [0.5, 0.95])
        return float(median), float(high)


def check_flight(
    model: LiftedModel,
    chi: np.ndarray,
    zeta: np.ndarray,
    *,
    alpha: tuple[Alpha, Alpha] | None = None,
    horizon: int = HORIZON,
    spacing: int = 1,
    refit: bool | None = None,
    gamma: float | None = None,
) -> BoundCheck:
    """Compute bounds and errors after every `spacing`-th sample of one uninterrupted flight.

    Args:
        chi: (n, 6) labels [N, N·m].
        zeta: (n, 6) motion [m/s, rad/s].
        alpha: (alpha_chi, alpha_zeta); None for the flight's own largest changes, under which the
            premise holds.
        horizon: as of `TheoremBound` [1].
        spacing: samples from one origin to the next [1].
        refit: as of `TheoremBound`.
        gamma: likewise [1].
    Raises: ValueError: if the flight is too short for one window.
    """
    alpha = largest_changes(model, chi, zeta, horizon) if alpha is None else alpha
    dut = TheoremBound(model, *alpha, horizon=horizon, refit=refit, gamma=gamma)
    model = dut.model
    samples = np.hstack([chi, zeta])
    origins = np.arange(dut.samples - 1, len(samples) - horizon, spacing)
    if len(origins) == 0:
        raise ValueError(
            f"bound: at least {dut.samples + horizon} samples are needed; got {len(samples)}."
        )
    z = np.full((len(samples), model.system.K), np.nan)
    z[model.window - 1 :] = model.lift(
        sliding_window_view(samples, model.window, axis=0).swapaxes(1, 2)
    )
    parts = [_check(dut, samples, z, origins[i : i + CHUNK]) for i in range(0, len(origins), CHUNK)]
    found = {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}
    holds, premise = found["holds"], _premise(model, dut.change, samples, origins)
    broken = {name: float(found[name].mean()) for name in ASSUMPTIONS if found[name].any()}
    return BoundCheck(
        windows=len(origins),
        holds=float(holds.mean()),
        premise=float(premise.mean()),
        holds_on_premise=float(holds[premise].mean()) if premise.any() else np.nan,
        ratio={kind: found[kind] for kind in KINDS},
        c=found["c"],
        residual=found["residual"],
        violated=broken,
        spectral_radius=float(found["spectral_radius"].max()),
        lipschitz=dut.reach.lipschitz,
        alpha_chi=float(dut.change.chi[0]),
        alpha_zeta=float(dut.change.zeta[0]),
    )


def _check(
    dut: TheoremBound, samples: np.ndarray, z: np.ndarray, origins: np.ndarray
) -> dict[str, np.ndarray]:
    """Return the quantities that `BoundCheck` collects, (windows, …) each."""
    answers = [dut(samples[k - dut.samples + 1 : k + 1]) for k in origins]
    errors = _errors(dut.model, answers, samples, z, origins, dut.horizon)
    bounds = {kind: np.stack([getattr(a, kind) for a in answers]) for kind in KINDS}
    holds = np.all(
        [errors[k] <= bounds[k] * (1 + ROUNDING) + RESOLUTION for k in KINDS], axis=(0, 2)
    )
    found = {"holds": holds} | {kind: _ratio(bounds[kind], errors[kind]) for kind in KINDS}
    for name in ("c", "residual", "spectral_radius"):
        found[name] = np.array([getattr(a, name) for a in answers])
    return found | {name: np.array([name in a.violated for a in answers]) for name in ASSUMPTIONS}


def _errors(
    model: LiftedModel,
    answers: list[ErrorBound],
    samples: np.ndarray,
    z: np.ndarray,
    origins: np.ndarray,
    N: int,
) -> dict[str, np.ndarray]:
    """Return kind -> error of the rollouts (windows, N), with the true zeta and with zeta held."""
    A, B = (np.stack([getattr(a.system, name) for a in answers]) for name in "AB")
    C, rows = model.system.C, slice(6 if model.predicts_torque else 3)
    found = {kind: np.empty((len(origins), N)) for kind in KINDS}
    for suffix, moving in (("", 1), ("_held", 0)):
        z_hat = z[origins]
        for i in range(N):
            zeta = samples[origins + moving * i, 6:]
            z_hat = np.einsum("nij,nj->ni", A, z_hat) + np.einsum("nij,nj->ni", B, zeta)
            k = origins + i + 1
            found["z" + suffix][:, i] = np.linalg.norm(z[k] - z_hat, axis=1)
            off = (samples[k, :6] - z_hat @ C.T) / chi_scale(model)
            found["chi" + suffix][:, i] = np.linalg.norm(off[:, rows], axis=1)
    return found | {"operator": found["z"]}


def _premise(
    model: LiftedModel, change: Change, samples: np.ndarray, origins: np.ndarray
) -> np.ndarray:
    """Return whether every change that the proof bounds was within what was allowed, (windows,)."""
    chi, zeta = samples[:, :6] / chi_scale(model), samples[:, 6:] / model.zeta_scale
    good = np.ones(len(samples), bool)
    for j in range(1, len(change.chi) + 1):
        for values, allowed in ((chi, change.chi), (zeta, change.zeta)):
            moved = np.linalg.norm(values[j:] - values[:-j], axis=1)
            good[:-j] &= moved <= allowed[j - 1] * (1 + ROUNDING)
    # Samples from which the proof counts changes
    span = 2 if isinstance(model.encoder, Phi) else model.window + 1
    return sliding_window_view(good, span)[origins - span + 1].all(axis=1)


def _ratio(bounds: np.ndarray, errors: np.ndarray) -> np.ndarray:
    return np.divide(bounds, errors, out=np.full_like(bounds, np.nan), where=errors > RESOLUTION)
