"""A Gaussian process of the motion: exact mean and Jacobian in closed form."""

import dataclasses as dc
import warnings
from collections.abc import Sequence
from typing import Any

import numpy as np

from np_drake.training_data.segments import Segment, check_segments, group_scale


@dc.dataclass(frozen=True)
class GaussianProcess:
    """Posterior mean of a Gaussian process of the motion, one process a component of chi.

        chi_c = mean_c + sum over n of weight_nc exp(-|(zeta - X_n) / length_c|² / 2)

    Source: Rasmussen, Williams 2006, eq. (2.25), with the RBF kernel of Jin et al. 2025.
    Away from the data the mean falls back to that of the labels.
    """

    X: np.ndarray  # (n, 6) training inputs [m/s, rad/s]
    weight: np.ndarray  # (n, 6) [N, N·m]
    length: np.ndarray  # (6, 6), component by input
    mean: np.ndarray  # (6,) [N, N·m]

    def __post_init__(self):
        n = len(self.X)
        wanted = {"X": (n, 6), "weight": (n, 6), "length": (6, 6), "mean": (6,)}
        for name, shape in wanted.items():
            if np.shape(getattr(self, name)) != shape:
                raise ValueError(
                    f"GaussianProcess: {name} must be {shape}; got {np.shape(getattr(self, name))}."
                )
        if not np.all(self.length > 0):
            raise ValueError("GaussianProcess: length must be positive.")
        object.__setattr__(self, "_precision", (1.0 / self.length**2).T.copy())

    def __call__(self, zeta: np.ndarray) -> np.ndarray:
        """Return the mean of chi (..., 6) [N, N·m] at zeta (..., 6) [m/s, rad/s]."""
        return self.mean + self._terms(zeta)[1].sum(axis=-2)

    def jacobian(self, zeta: np.ndarray) -> np.ndarray:
        """Return dchi/dzeta (n, 6, 6) at zeta (n, 6)."""
        away, terms = self._terms(zeta)
        return -np.swapaxes(terms, -1, -2) @ away * self._precision.T  # type: ignore[attr-defined]

    def tensors(self) -> dict[str, np.ndarray]:
        """Return the arrays that a model file holds, by name."""
        return {field.name: getattr(self, field.name) for field in dc.fields(self)}

    @classmethod
    def from_tensors(cls, tensors: dict[str, np.ndarray]) -> "GaussianProcess":
        """Return the process of the arrays in a model file.

        Raises: KeyError, ValueError: on missing or inconsistent arrays.
        """
        return cls(**{field.name: tensors[field.name] for field in dc.fields(cls)})

    def _terms(self, zeta: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return zeta - X_n and the terms of the sum, (..., n, 6) each."""
        away = np.asarray(zeta)[..., None, :] - self.X
        return away, self.weight * np.exp(-0.5 * (away**2 @ self._precision))  # type: ignore[attr-defined]


@dc.dataclass(frozen=True)
class GaussianProcessConfig:
    """Parameters of the Gaussian process: RBF kernel and 100 samples as in the paper.

    Source of bounds and restarts: own choice.
    """

    samples: int = 100  # evenly spaced in time over the flights [1]
    restarts: int = 1  # of the search for hyperparameters, beside the one from unit lengths [1]
    # Of the kernel's lengths; below, noise is learnt [RMS of the inputs about their mean]
    length_bounds: tuple[float, float] = (0.5, 100.0)
    noise_bounds: tuple[float, float] = (
        1e-6,
        1.0,
    )  # variance of the labels' noise [variance of the labels]
    seed: int = 0  # of the restarts


def fit_gaussian_process(
    segments: Sequence[Segment], config: GaussianProcessConfig = GaussianProcessConfig()
) -> GaussianProcess:
    """Fit the process to the flights' smoothed labels by largest marginal likelihood.
    Raises: ValueError: if the segments are unusable.
    """
    checked = check_segments(list(segments), 1)
    zeta, chi = (np.concatenate([getattr(s, name) for s in checked]) for name in ("zeta", "goal"))
    rows = np.unique(np.linspace(0, len(zeta) - 1, config.samples).round().astype(int))
    scale = group_scale([zeta], centred=True)
    return closed_form(regressors(zeta[rows] / scale, chi[rows], config), scale)


def regressors(zeta: np.ndarray, chi: np.ndarray, config: GaussianProcessConfig) -> list[Any]:
    """Return one fitted scikit-learn process for each component of chi.

    Args:
        zeta: (n, 6), scaled.
        chi: (n, 6) [N, N·m].
    """
    from sklearn.exceptions import ConvergenceWarning
    from sklearn.gaussian_process import GaussianProcessRegressor
    from sklearn.gaussian_process.kernels import RBF, ConstantKernel, WhiteKernel

    found = []
    for component in chi.T:
        smooth = ConstantKernel(1.0, (1e-4, 1e4)) * RBF(np.ones(6), config.length_bounds)
        kernel = smooth + WhiteKernel(0.01, config.noise_bounds)
        process = GaussianProcessRegressor(
            kernel, normalize_y=True, n_restarts_optimizer=config.restarts, random_state=config.seed
        )
        with warnings.catch_warnings():
            # A length at its upper bound is how the likelihood says that an input does not count.
            warnings.simplefilter("ignore", ConvergenceWarning)
            found.append(process.fit(zeta, component))
    return found


def closed_form(processes: Sequence[Any], scale: np.ndarray) -> GaussianProcess:
    """Return the mean of scikit-learn's processes, in physical units.

    Args:
        processes: one for each component of chi, of zeta / scale.
        scale: (6,) [m/s, rad/s].
    """
    smooth = [process.kernel_.k1 for process in processes]  # the sum without the labels' noise
    weight = [
        process.alpha_ * process._y_train_std * kernel.k1.constant_value
        for process, kernel in zip(processes, smooth, strict=True)
    ]
    return GaussianProcess(
        X=processes[0].X_train_ * scale,
        weight=np.stack(weight, axis=1),
        length=np.stack([kernel.k2.length_scale * scale for kernel in smooth]),
        mean=np.array([float(process._y_train_mean) for process in processes]),
    )
