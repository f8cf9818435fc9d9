"""Run time of one sample of a predictor in flight, against the pseudo-inverse of the window."""

import dataclasses as dc
import time
from collections.abc import Callable

import numpy as np

from np_drake.lifting.model.encoders import Phi
from np_drake.lifting.model.lifted_linear_system import stabilized
from np_drake.lifting.model.lifted_model import PAPER, LiftedModel
from np_drake.lifting.model.window_refit import RADIUS
from np_drake.lifting.training.train import make_config, train
from np_drake.residual_model import Sample, WrenchForecast
from np_drake.residual_models.neural_predictor import NeuralPredictor
from np_drake.training_data.segments import Segment

HORIZON = 20  # steps that are predicted [1]
STEP = 0.0025  # of the synthetic flight [s]
SAMPLES = 1200  # that the models are trained on [1]
BLOCK = 20  # samples until the next has its turn, as in the benchmark of the solvers [1]
REFERENCE, STABLE_REFERENCE = "pseudo-inverse", "pseudo-inverse, made stable"


@dc.dataclass(frozen=True)
class Timing:
    """Run time of one predictor.

    median_ms, p95_ms: of one sample, refit (where there is one), lift and 20 steps [ms].
    ratio: of medians, to the pseudo-inverse in the same run [1].
    """

    name: str  # of the predictor
    median_ms: float
    p95_ms: float
    ratio: float


class PseudoInverse:
    """Least squares [A B] = Z+ pinv([Z, zeta]) of the newest 40 samples, Z = Phi(chi), as in the
    paper, no prior.
    """

    def __init__(self, model: LiftedModel, *, stable: bool):
        """Take encoder and output matrix of a model.

        Args:
            model: of configuration `paper`.
            stable: with A then pulled into the unit circle, as `paper` does; without, it diverges
                on real flights.
        """
        assert isinstance(model.encoder, Phi)
        self._phi, self._C, self._stable = model.encoder, model.system.C, stable
        self._window = np.zeros((model.window, 12))

    def __call__(self, chi: np.ndarray, zeta: np.ndarray) -> np.ndarray:
        """Return the forecast (20, 6) from one more sample, the motion held [N, N·m].

        Args:
            chi: (6,) [N, N·m].
            zeta: (6,) [m/s, rad/s].
        """
        self._window = np.concatenate([self._window[1:], np.concatenate([chi, zeta])[None]])
        z = self._phi(self._window[:, :6])
        solution = np.linalg.pinv(np.hstack([z[:-1], self._window[:-1, 6:]])) @ z[1:]
        K = z.shape[1]
        A = stabilized(solution[:K].T, RADIUS) if self._stable else solution[:K].T
        forecast = WrenchForecast(A, solution[K:].T, self._C, z[-1], np.zeros((HORIZON, 6)))
        return forecast.rollout(np.tile(zeta, (HORIZON, 1)))


class InFlight:
    """Predictor that is fed as the controller feeds it."""

    def __init__(self, model: LiftedModel):
        self._dut = NeuralPredictor(model)
        self._memory = self._dut.initial_memory()

    def __call__(self, chi: np.ndarray, zeta: np.ndarray) -> np.ndarray:
        """Return the forecast (20, 6) from one more sample, the motion held [N, N·m].

        Args:
            chi: (6,) [N, N·m].
            zeta: (6,) [m/s, rad/s].
        """
        x = np.concatenate([np.zeros(3), [1.0, 0.0, 0.0, 0.0], zeta])
        self._memory = self._dut.update(self._memory, Sample(x, np.zeros(4), chi))
        forecast = self._dut.forecast(self._memory, horizon=HORIZON, stride=1)
        return forecast.rollout(np.tile(zeta, (HORIZON, 1)))


def synthetic_flight(samples: int, seed: int) -> Segment:
    """Return smooth force and torque driven by a smooth motion, with windows as singular as those
    of real flights.

    Args:
        samples: of the flight [1].
    """
    draw, t = np.random.default_rng(seed), STEP * np.arange(samples)[:, None, None]
    rate, phase = draw.uniform(2.0, 25.0, (12, 8)), draw.uniform(0, 2 * np.pi, (12, 8))
    waves = np.sin(rate * t + phase).sum(axis=2)
    return Segment(
        waves[:, :6] * np.repeat([1.0, 0.05], 3), waves[:, 6:] + 0.2 * waves[:, :6], STEP
    )


def models(seed: int) -> dict[str, LiftedModel]:
    """Return all configurations, trained briefly, since run time does not depend on how well they
    predict.
    """
    segment = synthetic_flight(SAMPLES, seed)
    configs = {
        "paper": make_config(PAPER, seed=seed, epochs=1),
        "lifted": make_config("lifted", seed=seed, steps=20),
        "mode-dictionary": make_config("mode-dictionary", frame="body", seed=seed),
    }
    return {name: train([segment], config).model for name, config in configs.items()}


def predictor_timings(seed: int, *, repeats: int = 1000) -> list[Timing]:
    """Time all predictors and the pseudo-inverse, taking turns at blocks of one synthetic
    flight.
    """
    trained = models(seed)
    paper = trained["paper"]
    duts: dict[str, Callable[[np.ndarray, np.ndarray], np.ndarray]] = {
        REFERENCE: PseudoInverse(paper, stable=False),
        STABLE_REFERENCE: PseudoInverse(paper, stable=True),
        **{name: InFlight(model) for name, model in trained.items()},
    }
    warm = max(model.window for model in trained.values())
    flight, spent = (
        synthetic_flight(repeats + warm, seed + 1),
        {name: list[float]() for name in duts},
    )
    with np.errstate(all="ignore"):  # the plain reference may overflow
        for block in range(0, len(flight), BLOCK):
            for name, dut in duts.items():
                rows = slice(block, block + BLOCK)
                for chi, zeta in zip(flight.chi[rows], flight.zeta[rows], strict=True):
                    start = time.perf_counter()
                    dut(chi, zeta)
                    spent[name].append(1e3 * (time.perf_counter() - start))
    tails = {name: np.array(values[-repeats:]) for name, values in spent.items()}
    base = float(np.median(tails[REFERENCE]))
    return [
        Timing(
            name,
            float(np.median(tail)),
            float(np.quantile(tail, 0.95)),
            float(np.median(tail)) / base,
        )
        for name, tail in tails.items()
    ]
