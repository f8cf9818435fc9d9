"""Bound on the error of the lifted prediction (Theorem 1), computed before the error is seen.

E_n = z_n - z_hat_n with z_hat_0 = z_0, z_hat_(i+1) = A z_hat_i + B zeta_i and the A, B that fly.
Source: Jin et al. 2025, Theorem 1, corrected; proof in docs/reference/error-bound.md.
"""

import dataclasses as dc

import numpy as np

from np_drake.lifting.bounds.encoder_reach import (
    Change,
    chi_scale,
    contracts,
    encoder_reach,
    powers,
    spectral_norms,
    standing_still,
)
from np_drake.lifting.model.adaptive_family import AdaptiveFamily
from np_drake.lifting.model.encoders import Phi
from np_drake.lifting.model.lifted_linear_system import LiftedLinearSystem
from np_drake.lifting.model.lifted_model import LiftedModel
from np_drake.lifting.model.window_refit import WindowRefit

Alpha = float | np.ndarray  # largest change over one step, or (horizon,) over 1, 2, … steps [1]
HORIZON = 40  # steps [1]
ROUNDING = 1e-9  # relative excess that floating point may cause [1]
ASSUMPTIONS = ("step of chi", "step of zeta", "Lipschitz constant", "stability")
CHI_STEP, ZETA_STEP, LIPSCHITZ, STABILITY = ASSUMPTIONS


@dc.dataclass(frozen=True)
class Assumption:
    """One assumption of the theorem: the value found, and the limit that it must keep."""

    name: str  # one of `ASSUMPTIONS`
    value: float
    limit: float
    holds: bool  # whether the value keeps the limit


@dc.dataclass(frozen=True)
class ErrorBound:
    """Bounds after one window for the next N steps; norms of chi are of chi / scale."""

    c: float  # upper bound on |z_1 - A z_0 - B zeta_0|, the first local error
    residual: float  # |z_0 - A z_-1 - B zeta_-1| of the window's own fit
    operator: np.ndarray  # (N,) sum_i |A^i| c_(n-1-i), the paper's form, c_0 = c
    z: np.ndarray  # (N,) at most that, the bound on |E_n|, with the true zeta in the rollout
    z_held: np.ndarray  # (N,) the same for a rollout that holds zeta_0
    chi: np.ndarray  # (N,) the same for chi_n - C z_hat_n, predicted channels
    chi_held: np.ndarray  # (N,) the same for chi_n - C z_hat_n, predicted channels
    scale: np.ndarray  # (6,) of chi [N, N·m]
    zeta_scale: np.ndarray  # (6,) [m/s, rad/s]
    system: LiftedLinearSystem  # A, B, C that fly
    assumptions: tuple[Assumption, ...]  # each with what was found

    @property
    def violated(self) -> tuple[str, ...]:
        """Names of the assumptions that do not hold; the bounds claim nothing where there is
        one.
        """
        return tuple(a.name for a in self.assumptions if not a.holds)

    @property
    def spectral_radius(self) -> float:
        """Spectral radius of the A that flies [1]."""
        return next(a.value for a in self.assumptions if a.name == STABILITY)

    @property
    def force(self) -> np.ndarray:
        """Bound on the error of the predicted force, (N,) [N]."""
        return self.chi * self.scale[:3].max()


@dc.dataclass(frozen=True)
class _Norms:
    """Norms |A^i|, |A^i B S_zeta| and |S_chi^-1 C A^i B S_zeta|, (N,) each, i = 0 … N-1, and
    whether A contracts.
    """

    A: np.ndarray
    B: np.ndarray
    CB: np.ndarray
    radius: float
    stable: bool


class TheoremBound:
    """Error bound of one model under given changes, called with a window.

    What all windows share is computed once.
    """

    def __init__(
        self,
        model: LiftedModel,
        alpha_chi: Alpha,
        alpha_zeta: Alpha,
        *,
        horizon: int = HORIZON,
        refit: bool | None = None,
        gamma: float | None = None,
    ):
        """Prepare the bound.

        Args:
            alpha_chi: largest |chi_(k+1) - chi_k| over the model's scales (those that Phi sees)
                [1]; or (horizon,) the largest change over 1, 2, … steps, which is sharper.
            horizon: number of steps N that are bounded [1].
            refit: whether A, B are refit on the window; None: as the model flies.
            gamma: limit that the Lipschitz constant of the encoder must keep; None: that of the
                training [1].
        Raises: ValueError: if an alpha is negative, the horizon less than one step, or theta
            changes in flight.
        """
        if horizon < 1:
            raise ValueError(f"bound: horizon must be at least 1 [steps]; got {horizon}.")
        if isinstance(model.encoder, AdaptiveFamily) and len(model.encoder.mean):
            raise ValueError(
                "bound: A, B and encoder must not change with theta. Train on one flight, "
                "--envelope 0."
            )
        # A forecast from the time of the label: a late one is not taken to the present
        self.model, self.horizon = dc.replace(model, late=0), horizon
        self.change = Change(_over_steps(alpha_chi, horizon), _over_steps(alpha_zeta, horizon))
        self.reach = encoder_reach(self.model, self.change)
        self._gamma = float(model.summary.get("gamma", np.inf) if gamma is None else gamma)
        self._scale = chi_scale(model)
        self._rows = slice(6 if model.predicts_torque else 3)
        refit = model.refits if refit is None else refit
        self._refit = WindowRefit(model) if refit else None
        self._offline = None if refit else self._norms(model.system)

    @property
    def samples(self) -> int:
        """Number of rows that a window must have; a delay encoder needs one more than it sees, for
        the residual.
        """
        return self.model.window + (0 if isinstance(self.model.encoder, Phi) else 1)

    def system(self, window: np.ndarray) -> LiftedLinearSystem:
        """Return the lifted linear system that flies after this window."""
        if self._refit is None:
            return self.model.system
        A, B = self._refit(window[-self.model.window :])
        return dc.replace(self.model.system, A=A, B=B)

    def __call__(self, window: np.ndarray) -> ErrorBound:
        """Return the bound after a window of [chi, zeta] (at least `samples`, 12), oldest first.

        Raises: ValueError: if the window is too short or not finite.
        """
        window = self._checked(window)
        system = self.system(window)
        norms = self._offline or self._norms(system)
        z = self._lift(window)
        residual = float(
            np.linalg.norm(z - system.A @ self._lift(window[:-1]) - system.B @ window[-2, 6:])
        )
        local = residual + (1.0 + norms.A[1]) * self.reach.travel + norms.B[0] * self.change.zeta
        operator = np.convolve(norms.A[: self.horizon], local)[: self.horizon]
        held = self._held(system, z, window[-1, 6:])
        still = standing_still(self.model, window, self.horizon)
        z_held = np.linalg.norm(still - held, axis=1) + self.reach.radius
        off = ((window[-1, :6] - held @ system.C.T) / self._scale)[:, self._rows]
        chi_held = np.linalg.norm(off, axis=1) + self.change.chi
        return ErrorBound(
            c=float(local[0]),
            residual=residual,
            operator=operator,
            z=np.minimum(operator, z_held + self._moved(norms.B)),
            z_held=z_held,
            chi=chi_held + self._moved(norms.CB),
            chi_held=chi_held,
            scale=self._scale,
            zeta_scale=self.model.zeta_scale,
            system=system,
            assumptions=self._assumptions(window, norms),
        )

    def _moved(self, norms: np.ndarray) -> np.ndarray:
        """Return sum_(i<n) norms_i |zeta_(n-1-i) - zeta_0|, (N,).

        It is the effect of a change of zeta that the rollout does not know.
        """
        return np.convolve(norms, np.concatenate([[0.0], self.change.zeta]))[: self.horizon]

    def _held(self, system: LiftedLinearSystem, z: np.ndarray, zeta: np.ndarray) -> np.ndarray:
        """Return z_hat_n, n = 1 … N, with zeta held, (N, K)."""
        drive = system.B @ zeta
        out = np.empty((self.horizon, len(z)))
        for i in range(self.horizon):
            out[i] = z = system.A @ z + drive
        return out

    def _lift(self, window: np.ndarray) -> np.ndarray:
        return self.model.lift(window[-self.model.window :])

    def _checked(self, window: np.ndarray) -> np.ndarray:
        window = np.asarray(window, float)
        if window.ndim != 2 or window.shape[1] != 12 or len(window) < self.samples:
            raise ValueError(
                f"bound: window must be (at least {self.samples}, 12); got {window.shape}."
            )
        if not np.all(np.isfinite(window)):
            raise ValueError("bound: window must be finite; cut the log where a sample is missing.")
        return window[-self.samples :]

    def _norms(self, system: LiftedLinearSystem) -> _Norms:
        B = powers(system.A, system.B * self.model.zeta_scale, self.horizon)
        CB = ((system.C / self._scale[:, None]) @ B)[:, self._rows]
        A = spectral_norms(powers(system.A, np.eye(system.K), max(self.horizon, 2)))
        radius = system.spectral_radius
        return _Norms(
            A, spectral_norms(B), spectral_norms(CB), radius, radius < 1.0 and contracts(system.A)
        )

    def _assumptions(self, window: np.ndarray, norms: _Norms) -> tuple[Assumption, ...]:
        steepest, gamma = self.reach.lipschitz, self._gamma
        return (
            self._seen(CHI_STEP, window[:, :6] / self._scale, self.change.chi),
            self._seen(ZETA_STEP, window[:, 6:] / self.model.zeta_scale, self.change.zeta),
            Assumption(
                LIPSCHITZ,
                steepest,
                gamma,
                bool(np.isfinite(steepest) and steepest <= gamma * (1 + ROUNDING)),
            ),
            Assumption(STABILITY, norms.radius, 1.0, norms.stable),
        )

    def _seen(self, name: str, window: np.ndarray, allowed: np.ndarray) -> Assumption:
        """Compare the window's changes, up to its last row and from row to row, with what was
        allowed.
        """
        step = np.linalg.norm(np.diff(window, axis=0), axis=1).max()
        since = np.linalg.norm(window[-2::-1] - window[-1], axis=1)[: self.horizon]
        holds = step <= allowed[0] * (1 + ROUNDING) and np.all(
            since <= allowed[: len(since)] * (1 + ROUNDING)
        )
        return Assumption(name, float(step), float(allowed[0]), bool(holds))


def largest_changes(
    model: LiftedModel, chi: np.ndarray, zeta: np.ndarray, horizon: int = HORIZON
) -> tuple[np.ndarray, np.ndarray]:
    """Return (alpha_chi, alpha_zeta), the largest scaled changes of a flight over 1, 2, … steps,
    (horizon,) each [1].

    Their first entries are the theorem's alphas.

    Args:
        chi: (n, 6) [N, N·m].
        zeta: (n, 6) [m/s, rad/s].
        horizon: most steps of a change [1].
    """
    return _largest(chi / chi_scale(model), horizon), _largest(zeta / model.zeta_scale, horizon)


def _largest(values: np.ndarray, horizon: int) -> np.ndarray:
    lags = range(1, horizon + 1)
    return np.array(
        [np.linalg.norm(values[j:] - values[:-j], axis=1).max(initial=0.0) for j in lags]
    )


def _over_steps(alpha: Alpha, horizon: int) -> np.ndarray:
    """Return the change over j steps, (horizon,): j alpha for a number, else as given."""
    if np.ndim(alpha) == 0:
        return float(alpha) * np.arange(1, horizon + 1)  # type: ignore[arg-type]
    value = np.asarray(alpha, float)
    if value.ndim != 1 or len(value) < horizon:
        raise ValueError(
            f"bound: an alpha must be one number or ({horizon},), one a step; got {value.shape}."
        )
    return value[:horizon]
