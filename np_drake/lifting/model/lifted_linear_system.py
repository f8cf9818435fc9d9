"""The lifted linear system z+ = A z + B zeta, chi = C z, and the projection of a matrix onto a
spectral radius, in real arithmetic, fast enough for every sample of a flight.
"""

import dataclasses as dc

import numpy as np
from scipy.linalg import blas, lapack

# The limit lies this far inside, because two builds of LAPACK differ in the last bits. The pull's
# rounding moves an eigenvalue by at most K eps cond(V)^2 (Bauer-Fike), which is less while the
# condition is below the first number; up to the second the eigenvalues are counted once more.
_MARGIN = 1.0 - 1e-9
_CERTAIN, _ILL = 400.0, 1e8


def stabilized(A: np.ndarray, radius: float = 1.0) -> np.ndarray:
    """Return A (K, K) with every |eigenvalue| <= radius; unchanged where that holds already (to one
    part in 1e9).

    Eigenvalues outside are pulled radially onto the circle and keep their eigenvectors, so that
    stable modes stay as learned; where the eigenvectors are too ill-conditioned for that, all of A
    is scaled. Own choice: the nearest stable matrix in the Frobenius norm is a non-convex problem,
    too slow for a flight.

    Args:
        A: (K, K).
        radius: [1].
    Raises: numpy.linalg.LinAlgError: if an entry of A is not finite, or its eigenvalues do not
        converge.
    """
    return _stabilized(A, radius)[0] if A.size else A


def stabilized_all(A: np.ndarray, radius: float = 1.0) -> tuple[np.ndarray, np.ndarray]:
    """Return every A made stable, (n, K, K), and the spectral radii before, (n,).

    Args:
        A: (n, K, K).
        radius: as of `stabilized` [1].
    """
    stable, before = np.empty_like(A), np.empty(len(A))
    for k, one in enumerate(A):
        stable[k], before[k] = _stabilized(one, radius)
    return stable, before


def _stabilized(A: np.ndarray, radius: float) -> tuple[np.ndarray, float]:
    """Return one A made stable, and its spectral radius before.

    LAPACK's own real form of V costs less than numpy's complex one.
    """
    if not np.isfinite(A).all():
        raise np.linalg.LinAlgError("stabilized: every entry of A must be finite.")
    re, im, _, V, info = lapack.dgeev(A, compute_vl=0, compute_vr=1)
    if info:
        raise np.linalg.LinAlgError("stabilized: the eigenvalues of A must converge.")
    size = np.hypot(re, im)
    largest, limit = float(size.max()), radius * _MARGIN
    if largest <= limit:
        return A, largest
    pulled, condition = _pulled(A, V, size, limit)
    if condition < _CERTAIN or (condition < _ILL and _radius(pulled) <= radius):
        return pulled, largest
    return A * (limit / largest), largest


def _pulled(
    A: np.ndarray, V: np.ndarray, size: np.ndarray, limit: float
) -> tuple[np.ndarray, float]:
    """Return A V diag(factor) V^-1, factor < 1 where the eigenvalue's size (K,) > limit, and a
    bound of V's condition.

    V (K, K) holds Re and Im of a pair's eigenvector side by side; the two share their factor, so
    that A V need not be separated. The complex columns have length 1, and the rows of their inverse
    are no longer than those of the real one.
    """
    lu, pivots, singular = lapack.dgetrf(V)
    if singular:  # no full set of eigenvectors
        return A, np.inf
    inverse = lapack.dgetri(lu, pivots, overwrite_lu=1)[0]
    condition = len(A) ** 0.5 * float(blas.dnrm2(inverse.ravel("K")))
    if not condition < _ILL:
        return A, np.inf
    # A V diag(f) V^-1 = A + A V diag(f - 1) V^-1, where f is 1 inside: a sum over the few columns
    # outside
    outside = np.flatnonzero(size > limit)
    less = limit / size[outside] - 1.0
    return A + (A @ (V[:, outside] * less)) @ inverse[outside], condition


def _radius(A: np.ndarray) -> float:
    """Return the spectral radius [1]."""
    return float(np.abs(np.linalg.eigvals(A)).max())


@dc.dataclass(frozen=True)
class LiftedLinearSystem:
    """Discrete-time linear system z+ = A z + B zeta, chi = C z.

    Source: Jin et al. 2025, eq. (lls).
    """

    A: np.ndarray  # (K, K)
    B: np.ndarray  # (K, 6) per [m/s, rad/s]
    C: np.ndarray  # (6, K) in [N, N·m]
    step: float  # time of one application of A [s]

    def __post_init__(self):
        K = len(self.A)
        if self.A.shape != (K, K) or self.B.shape != (K, 6) or self.C.shape != (6, K):
            shapes = f"{self.A.shape}, {self.B.shape}, {self.C.shape}"
            raise ValueError(
                f"LiftedLinearSystem: A, B, C must be (K, K), (K, 6), (6, K); got {shapes}."
            )
        if not self.step > 0:
            raise ValueError(f"LiftedLinearSystem: step must be positive [s]; got {self.step}.")

    @property
    def K(self) -> int:
        """Number of lifted states."""
        return len(self.A)

    @property
    def spectral_radius(self) -> float:
        """Largest |eigenvalue| of A [1]."""
        return float(np.max(np.abs(np.linalg.eigvals(self.A)))) if self.K else 0.0

    def resample(self, stride: int) -> "LiftedLinearSystem":
        """Return the system at `stride` times its step, with zeta held over the longer step.

        The new matrices are A^m and sum_(i<m) A^i B with m = stride.
        Raises: ValueError: if stride is not a positive whole number, which would need a matrix
            logarithm.
        """
        if stride < 1 or int(stride) != stride:
            raise ValueError(
                f"LiftedLinearSystem: stride must be a positive whole number; got {stride}."
            )
        if stride == 1:
            return self
        # [[A, B], [0, 1]]^m = [[A^m, sum_(i<m) A^i B], [0, 1]], as zeta is held
        augmented = np.eye(self.K + 6)
        augmented[: self.K] = np.hstack([self.A, self.B])
        power = np.linalg.matrix_power(augmented, int(stride))
        A, B = power[: self.K, : self.K], power[: self.K, self.K :]
        return LiftedLinearSystem(A, B, self.C, self.step * stride)


def advance(z: np.ndarray, A: np.ndarray, B: np.ndarray, zeta: np.ndarray) -> np.ndarray:
    """Return z (..., K) after the steps of `zeta`, from z (..., K).

    Args:
        z: (..., K) at the first of them.
        A: (..., K, K), one for all or one each.
        B: (..., K, 6), likewise.
        zeta: (..., steps, 6) [m/s, rad/s].
    """
    for i in range(zeta.shape[-2]):
        z = (A @ z[..., None] + B @ zeta[..., i, :, None])[..., 0]
    return z
