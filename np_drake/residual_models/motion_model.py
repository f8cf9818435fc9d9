"""Residual models without memory: the wrench as a function of the motion at the same instant."""

import dataclasses as dc
import warnings
from collections.abc import Sequence
from typing import Any

import numpy as np

from np_drake import rigid_body
from np_drake.checks import require
from np_drake.residual_model import Memory, Sample, WrenchForecast, constant_forecast
from np_drake.trained_model import STEPS, Array, ModelFile, Perceptron, number_in, summary_in
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
            require(
                np.shape(getattr(self, name)) == shape,
                f"GaussianProcess: {name} must be {shape}; got {np.shape(getattr(self, name))}.",
            )
        require(np.all(self.length > 0), "GaussianProcess: length must be positive.")
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
    # variance of the labels' noise [variance of the labels]
    noise_bounds: tuple[float, float] = 1e-6, 1.0
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

    processes = []
    for component in chi.T:
        smooth = ConstantKernel(1.0, (1e-4, 1e4)) * RBF(np.ones(6), config.length_bounds)
        kernel = smooth + WhiteKernel(0.01, config.noise_bounds)
        process = GaussianProcessRegressor(
            kernel, normalize_y=True, n_restarts_optimizer=config.restarts, random_state=config.seed
        )
        with warnings.catch_warnings():
            # A length at its upper bound is how the likelihood says that an input does not count.
            warnings.simplefilter("ignore", ConvergenceWarning)
            processes.append(process.fit(zeta, component))
    return processes


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


@dc.dataclass(frozen=True)
class WrenchNetwork:
    """Perceptron chi = unit N(zeta / scale).

    Unlike the layers of Phi, these have biases: a payload pulls on the vehicle at rest too. At a
    kink of a ReLU the Jacobian is that of the inactive side.
    """

    network: Perceptron
    scale: Array  # (6,) of zeta [m/s, rad/s]
    unit: Array  # (6,) of chi [N, N·m]

    def __post_init__(self):
        self.network.require_sizes(6, 6)
        require(
            self.scale.shape == (6,) and self.unit.shape == (6,),
            "WrenchNetwork: scale and unit must have six entries.",
        )

    def __call__(self, zeta: Array) -> Array:
        """Return chi (..., 6) [N, N·m] at zeta (..., 6) [m/s, rad/s]."""
        return self.network(zeta / self.scale) * self.unit

    def jacobian(self, zeta: np.ndarray) -> np.ndarray:
        """Return dchi/dzeta (n, 6, 6) at zeta (n, 6)."""
        value = zeta / self.scale
        (*hidden, last) = self.network.weights
        slope = np.broadcast_to(np.diag(1.0 / self.scale), (*value.shape, 6))
        for W, b in zip(hidden, self.network.biases[:-1], strict=True):
            before = value @ W.T + b
            value = np.maximum(before, 0.0)
            slope = (before > 0)[..., None] * (W @ slope)
        return self.unit[:, None] * (last @ slope)

    def tensors(self) -> dict[str, np.ndarray]:
        """Return the arrays that a model file holds, by name."""
        return self.network.tensors() | {"scale": self.scale, "unit": self.unit}

    @classmethod
    def from_tensors(cls, tensors: dict[str, np.ndarray]) -> "WrenchNetwork":
        """Return the network of the arrays in a model file.

        Raises: KeyError, ValueError: on missing or inconsistent arrays.
        """
        return cls(Perceptron.taken_from(tensors), tensors["scale"], tensors["unit"])


GP = "gp"  # Gaussian process
KNODE = "knode"  # knowledge-based neural ordinary differential equation
REACTIONS: dict[str, type[GaussianProcess] | type[WrenchNetwork]] = {
    GP: GaussianProcess,
    KNODE: WrenchNetwork,
}
SCHEMA = "np_drake.motion_model/1"  # format of the file and its version


@dc.dataclass
class MotionModel(ModelFile):
    """Residual model chi_i = g(zeta_i), evaluated at every predicted state.

    It uses no label in flight, so that it cannot follow a change of the wrench at equal motion.
    Source: Torrente et al. 2021 (gp), Chee et al. 2022 (knode).
    """

    name: str  # gp | knode
    reaction: GaussianProcess | WrenchNetwork  # g
    step: float  # time between samples [s]
    summary: dict[str, Any] = dc.field(default_factory=dict)  # key figures of the training

    schema = SCHEMA

    def __post_init__(self):
        require(
            self.name in REACTIONS and isinstance(self.reaction, REACTIONS[self.name]),
            f"MotionModel: name must be {' | '.join(REACTIONS)}, as its reaction is; "
            f"got {self.name}.",
        )
        require(0 < self.step < np.inf, f"MotionModel: step must be positive [s]; got {self.step}.")

    def initial_memory(self) -> Memory:
        """Return the memory before any sample: zeta (6,) last measured [m/s, rad/s]."""
        return {"zeta": np.zeros(6)}

    def update(self, memory: Memory, sample: Sample) -> Memory:
        """Return the memory after one more sample; one with NaN leaves it as it is."""
        zeta = rigid_body.zeta(np.asarray(sample.x, float))
        return {"zeta": zeta.copy()} if np.all(np.isfinite(zeta)) else memory

    def forecast(self, memory: Memory, *, horizon: int, stride: int) -> WrenchForecast:
        """Return a forecast with the function itself, which the controller evaluates along its
        plan.
        """
        silent = constant_forecast(np.zeros(6), horizon)
        return dc.replace(silent, reaction=self.reaction, zeta=memory["zeta"])

    def content(self) -> tuple[dict[str, np.ndarray], dict[str, Any]]:
        """Return the arrays and the header of its file."""
        header = {"name": self.name, "step": self.step, "summary": self.summary}
        return self.reaction.tensors(), header

    @classmethod
    def of_content(cls, tensors: dict[str, np.ndarray], header: dict[str, Any]) -> "MotionModel":
        """Return the model of the content of a file."""
        reaction = REACTIONS[header["name"]].from_tensors(tensors)
        return cls(header["name"], reaction, number_in(header, "step", *STEPS), summary_in(header))
