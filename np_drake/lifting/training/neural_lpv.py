"""Training of the `neural-lpv` configuration on flights with many payloads.

Encoders and network descend on the error of forecasts of chi, up to the horizon ahead, along the
motion as it was flown. An error counts over its usual size in that flight, as in the likelihood of
normal errors whose variance is each flight's own: gusts would drown a calm flight otherwise. In
heave one size holds for all.
"""

import dataclasses as dc
import itertools
from typing import Any

import numpy as np
import scipy
import torch
from numpy.lib.stride_tricks import sliding_window_view
from torch import nn
from torch.nn.functional import pad, smooth_l1_loss

from np_drake.lifting.model.lpv_model import (
    ARRAYS,
    BLOCKS,
    DECAYING,
    DECAYS,
    NEW,
    OSCILLATORS,
    PARAMETERS,
    PLANE,
    RATES,
    TAPS,
    Array,
    Features,
    LpvModel,
)
from np_drake.lifting.training import OnEpoch
from np_drake.lifting.training.excitation import excitation
from np_drake.lifting.training.paper_training import gradient_step
from np_drake.trained_model import Perceptron
from np_drake.training_data.segments import Segment, check_segments

STRIDE = 2  # samples between two forecasts, as of the MPC
STEPS = 20  # forecasts ahead, as of the MPC
HORIZON = STRIDE * STEPS  # [samples]
EARLIEST = 5  # first origin of a flight [samples]
SPACING = 2  # between two origins [samples]
AVERAGED = 5  # labels that are averaged in what a forecast is compared with
# Of force in the planes, in heave, and of torque, here and in the next two
FINE = torch.tensor([0.03, 0.1, 0.04])  # least usual error [m/s²]
WEIGHT = torch.tensor([1.0, 0.1, 0.5])  # in the loss [1]
# Which have a usual error in each flight; in heave that would be of the jumps, and hide them.
PER_FLIGHT = torch.tensor([1.0, 0.0, 1.0])
TUNING = 3e-3  # rate of a step on another vehicle's flights, over the size of a parameter [1]
KEPT = 0.95  # of a flight's usual square error, at a new one [1]
ROBUST = 2.0  # error over the usual one beyond which it counts linearly [1]
TURNS = (0.07, 0.12)  # of the oscillators, at the start [1/step]
DAMPINGS = (6e-3,) * OSCILLATORS  # of the oscillators, at the start [1/step]
RATE = (2e-3, 0.04, 0.2)  # of the decays, at the start [1/step]
INPUT = 0.06  # unit of the network's inputs of the states [1]
DRAG = 0.3  # unit of its drags [1]
WEAK = 1e-4  # power of a direction that counts as none, over the strongest [1]
REPORTS = 20  # of the loss in a training
SHORTEST = 20  # gradient steps of which the rate has a course
PAIRS = np.triu_indices(2 * BLOCKS)  # of a symmetric matrix
TWICE = torch.from_numpy(np.where(PAIRS[0] == PAIRS[1], 1.0, 2.0)).float()


@dc.dataclass(frozen=True)
class NeuralLpvConfig:
    """Parameters of the `neural-lpv` configuration."""

    experts: int = 24  # encoders that the network mixes [1]
    width: int = 64  # neurons of each of the two hidden layers [1]
    probes: int = 32  # statistics of each decay [1]
    glances: int = 24  # sizes of the present [1]
    epochs: int = 28_000  # gradient steps [1]
    batch: int = 512  # forecasts of a step [1]
    learning_rate: float = 4e-3  # of Adam, rising over a tenth and falling along a cosine [1]
    matrix_rate: float = 0.05  # of Muon, of the encoders, likewise [1]
    # Of force, torque, velocity and body rate, of the vehicle [N, N·m, m/s, rad/s]
    units: tuple[float, float, float, float] = (2.0, 0.2, 1.0, 1.0)
    seed: int = 0  # of the initial weights and the forecasts of each step


def origins(segments: list[Segment], scale: np.ndarray) -> list[torch.Tensor]:
    """Return, of every instant that is forecast from: planes, heave, decaying means of the products
    of blocks and of the squares of climb, age, zeta from the step before on, chi ahead, and the
    number of the flight.

    Args:
        scale: (12,) units of [chi, zeta].
    """
    flights = [_origins(segment, scale) for segment in segments]
    parts = [np.concatenate(part).astype(np.float32) for part in zip(*flights, strict=True)]
    flight = np.repeat(np.arange(len(flights)), [len(one[0]) for one in flights])
    return [torch.from_numpy(part) for part in (*parts, flight)]


def _origins(segment: Segment, scale: np.ndarray) -> tuple[np.ndarray, ...]:
    samples = np.hstack([segment.chi, segment.zeta]) / scale
    D = TAPS.delay
    padded = np.concatenate([np.repeat(samples[:1], D - 1, axis=0), samples])
    seen = Features.of(np.moveaxis(sliding_window_view(padded, D, axis=0), -1, -2))
    squares = np.einsum("npi,npj->nij", seen.blocks, seen.blocks)[:, PAIRS[0], PAIRS[1]]
    count = np.arange(1, len(samples) + 1)[:, None]
    at = np.arange(EARLIEST, len(samples) - HORIZON, SPACING)
    products, climb = (
        np.stack(
            [scipy.signal.lfilter([1 - d], [1, -d], of, axis=0) / (1 - d**count) for d in DECAYS],
            axis=1,
        )[at]
        for of in (squares, seen.climb**2)
    )
    smooth = scipy.ndimage.uniform_filter1d(samples[:, :6], AVERAGED, axis=0)
    return (
        seen.planes[at],
        seen.heave[at],
        products,
        climb,
        np.minimum(count[at], NEW) / NEW,
        samples[at[:, None] + np.arange(-1, HORIZON), 6:],
        smooth[at[:, None] + STRIDE * np.arange(STEPS + 1)],
    )


class ScheduledNetwork(nn.Module):
    """A model with gradients."""

    def model(self, step: float = 1.0) -> LpvModel:
        """Return the model, of tensors."""
        raise NotImplementedError

    def forecast(self, planes, heave, products, climb, age, zeta) -> torch.Tensor:
        """Return chi now and every `STRIDE` samples ahead, without units, (n, STEPS + 1, 6).

        Args:
            zeta: (n, HORIZON + 1, 6) from the step before on, of which `STRIDE` are averaged.
        """
        model = self.model()
        states, theta = model.schedule(
            planes, heave, energies(model.probes, products, climb), age, torch
        )
        A, B, C = model.matrices(theta, torch)
        A, B = A @ A, A @ B + B
        z = torch.cat([states, zeta[:, 0, :3]], dim=1)[..., None]
        course = []
        drive = B @ zeta[:, 1:].unflatten(1, (STEPS, STRIDE)).mean(dim=2).mT
        for i in range(STEPS):
            course.append(z)
            z = torch.baddbmm(drive[..., i : i + 1], A, z)
        return (C @ torch.cat([*course, z], dim=2)).mT

    def errors(self, rows: list[torch.Tensor]) -> list[torch.Tensor]:
        """Return the errors of forecasts without units, of force in the planes, in heave, and of
        torque, (n, STEPS + 1, 2 | 1 | 2).
        """
        *seen, goal, _ = rows
        error = self.forecast(*seen) - goal
        return [error[..., :2], error[..., 2:3], error[..., 3:5]]


class LpvNetwork(ScheduledNetwork):
    """A random model, its inputs in coordinates of unit variance.

    Args:
        seen: what `origins` returns, whose variance that is.
    """

    def __init__(self, config: NeuralLpvConfig, seen: list[torch.Tensor]):
        super().__init__()
        planes, heave, products, climb, age, *_ = seen
        self.scale = np.repeat(config.units, 3)
        J = config.experts
        taps = len(TAPS.matrix)
        mean = np.zeros((2 * BLOCKS, 2 * BLOCKS))
        mean[PAIRS] = products.mean(dim=(0, 1)).numpy()
        moving = planes.unflatten(-1, (taps, 4))[..., :3].flatten(-2)
        self.white = [_inverse_root(_moment(rows)) for rows in (moving, planes, heave)]
        self.white.append(_inverse_root(mean + np.triu(mean, 1).T))
        self.experts = nn.Parameter(0.02 * torch.randn(J * PLANE, 3 * taps))
        self.lifts = nn.Parameter(0.01 * torch.randn(J, DECAYING, 2 * taps))
        self.level = nn.Parameter(torch.zeros(4 * taps))
        self.torque = nn.Parameter(torch.zeros(PLANE))
        self.glances = nn.Parameter(0.1 * torch.randn(config.glances, 3 * taps))
        self.probes = nn.Parameter(torch.randn(len(DECAYS), config.probes, 2 * BLOCKS))
        read = len(DECAYS) * (config.probes + 2) + config.glances + 2 * taps + 1
        sizes = [read, config.width, config.width, J + PARAMETERS]
        self.layers = nn.ModuleList(nn.Linear(a, b) for a, b in itertools.pairwise(sizes))
        counts = torch.tensor([J + RATES, PLANE + DECAYING, 2])
        self.unit = torch.repeat_interleave(torch.tensor([1.0, INPUT, DRAG]), counts)
        self.mean = torch.zeros(read)
        self.spread = torch.ones(read)
        with torch.no_grad():
            last: Any = self.layers[-1]
            start = np.concatenate([TURNS, DAMPINGS, RATE, RATE])
            last.weight[J:] *= 0.1
            last.bias[J:] = 0.0
            last.bias[J : J + RATES] = torch.from_numpy(np.log(start))
            model = self.model()
            statistics = model.statistics(
                planes, heave, energies(model.probes, products, climb), age, torch
            )
        self.mean = statistics.mean(dim=0)
        self.spread = statistics.std(dim=0, correction=0) + 1e-3

    def model(self, step: float = 1.0) -> LpvModel:
        """Return the model of inputs as they are."""
        moving, planes, heave, blocks = self.white
        experts, glances = (
            pad((of @ moving.T).unflatten(-1, (-1, 3)), (0, 1)).flatten(-2)
            for of in (self.experts, self.glances)
        )
        weights, biases = ([getattr(x, of) for x in self.layers] for of in ("weight", "bias"))
        weights[0] = weights[0] / self.spread
        biases[0] = biases[0] - weights[0] @ self.mean
        weights[-1] = self.unit[:, None] * weights[-1]
        biases[-1] = self.unit * biases[-1]
        probes = self.probes / self.probes.norm(dim=-1, keepdim=True) @ blocks.T
        return LpvModel(
            step,
            self.scale,
            experts.unflatten(0, (-1, PLANE)),
            self.lifts @ heave.T,
            planes @ self.level,
            self.torque,
            probes,
            glances,
            Perceptron(tuple(weights), tuple(biases)),
        )


class FineTunedNetwork(ScheduledNetwork):
    """A trained model."""

    def __init__(self, prior: LpvModel):
        super().__init__()
        self.prior = prior
        arrays = [*(getattr(prior, name) for name in ARRAYS), *prior.network.tensors().values()]
        self.arrays = nn.ParameterList(torch.tensor(array).float() for array in arrays)

    def model(self, step: float = 1.0) -> LpvModel:
        """Return the model with the present arrays."""
        named = dict(zip(ARRAYS, self.arrays, strict=False))
        layers = list(self.arrays)[len(ARRAYS) :]
        depth = len(layers) // 2
        network = Perceptron(tuple(layers[:depth]), tuple(layers[depth:]))
        return dc.replace(self.prior, step=step, **named, network=network)


def energies(probes: Array, products: torch.Tensor, climb: torch.Tensor) -> torch.Tensor:
    """Return decaying means of `LpvModel.energies` (n, 2, P + 2).

    Args:
        probes: (2, P, 2 BLOCKS).
        products: (n, 2, pairs) decaying means of the products of blocks.
        climb: (n, 2, 2) of the squares of climb.
    """
    pairs = probes[..., PAIRS[0]] * probes[..., PAIRS[1]] * TWICE
    return torch.cat([torch.einsum("ndi,dpi->ndp", products, pairs).clip(0.0), climb], dim=-1)


def _moment(rows: torch.Tensor) -> np.ndarray:
    """Return the mean product of the last axis of rows, (f, f)."""
    flat = rows.reshape(-1, rows.shape[-1]).double()
    return (flat.T @ flat / len(flat)).numpy()


def _inverse_root(moment: np.ndarray) -> torch.Tensor:
    """Return W (f, f) that gives x W unit variance where x has the moment (f, f); directions of
    hardly any power stay small.
    """
    size = np.sqrt(np.diag(moment)) + 1e-6
    power, axes = np.linalg.eigh(moment / np.outer(size, size))
    root = np.sqrt(np.maximum(power, 0.0) + WEAK * max(power[-1], 1.0))
    return torch.from_numpy(axes / root / size[:, None]).float()


def train_neural_lpv(
    segments: list[Segment], config: NeuralLpvConfig, on_epoch: OnEpoch
) -> tuple[LpvModel, list[float]]:
    """Return (model, loss now and then)."""
    segments = check_segments(segments, EARLIEST + HORIZON + 2)
    seen = origins(segments, np.repeat(config.units, 3))
    with torch.random.fork_rng():
        torch.manual_seed(config.seed)
        network = LpvNetwork(config, seen)
    matrices: list[Any] = [network.experts, network.glances, network.layers[1].weight]
    others = [value for value in network.parameters() if all(value is not m for m in matrices)]
    optimisers = [
        torch.optim.Adam(others, lr=config.learning_rate),
        torch.optim.Muon(matrices, lr=config.matrix_rate, weight_decay=0.0),
    ]
    history = _descend(network, seen, optimisers, config, on_epoch, longest=1.0)
    model = network.requires_grad_(False).model(segments[0].step).in_numpy()
    return dc.replace(model, summary=_summary(segments, history)), history


def fine_tuned(
    prior: LpvModel, segments: list[Segment], *, epochs: int, on_epoch: OnEpoch = lambda *_: None
) -> LpvModel:
    """Return the model after some more gradient steps on other flights, of several manoeuvres: on
    a single one it forgets the rest.

    Args:
        epochs: gradient steps.
    Raises: ValueError: if the segments are unusable.
    """
    segments = check_segments(segments, EARLIEST + HORIZON + 2)
    network = FineTunedNetwork(prior)
    groups = [
        {"params": [value], "lr": TUNING * float(value.detach().square().mean().sqrt())}
        for value in network.parameters()
    ]
    config = NeuralLpvConfig(epochs=epochs)
    seen = origins(segments, prior.scale)
    history = _descend(network, seen, [torch.optim.Adam(groups)], config, on_epoch)
    model = network.requires_grad_(False).model(prior.step).in_numpy()
    return dc.replace(model, summary=prior.summary | _summary(segments, history))


def _summary(segments: list[Segment], history: list[float]) -> dict[str, Any]:
    """Return the key figures of a training."""
    return {
        "samples": sum(map(len, segments)),
        "loss": history[-1] if history else None,
        "excitation": excitation(segments),
    }


def _descend(
    network: ScheduledNetwork,
    seen: list[torch.Tensor],
    optimisers: list[Any],
    config: NeuralLpvConfig,
    on_epoch: OnEpoch,
    longest: float = np.inf,
) -> list[float]:
    """Descend on the errors of forecasts, and return the loss now and then.

    Args:
        seen: of `origins`.
        optimisers: whose rates rise over a tenth and fall along a cosine.
        longest: gradient, where all parameters are of one size.
    """
    generator = np.random.default_rng(config.seed)
    rates = [
        torch.optim.lr_scheduler.OneCycleLR(
            optimiser,
            [group["lr"] for group in optimiser.param_groups],
            max(config.epochs, SHORTEST),
            pct_start=0.1,
            div_factor=10,
            final_div_factor=30,
            cycle_momentum=False,
        )
        for optimiser in optimisers
    ]
    flights = int(seen[-1].max()) + 1
    usual = torch.ones(flights, len(FINE))  # square error of each flight
    losses = list[float]()
    history = list[float]()
    for step in range(1, config.epochs + 1):
        rows = generator.integers(len(seen[0]), size=config.batch)
        batch = [of[rows] for of in seen]
        errors = network.errors(batch)
        flight = batch[-1]
        size = (PER_FLIGHT * usual[flight] + FINE**2).sqrt()
        square = torch.stack([e.detach().square().mean(dim=(1, 2)) for e in errors], dim=1)
        count = torch.bincount(flight, minlength=flights)[:, None]
        mean = torch.zeros_like(usual).index_add_(0, flight, square) / count.clip(1)
        usual += (1 - KEPT) * (count > 0) * (mean - usual)
        parts = [e / size[:, i, None, None] for i, e in enumerate(errors)]
        robust = [smooth_l1_loss(e, torch.zeros_like(e), beta=ROBUST) for e in parts]
        loss = torch.stack(robust) @ WEIGHT
        losses.append(gradient_step(loss, optimisers, network.parameters(), longest=longest))
        for rate in rates:
            rate.step()
        if step % max(1, config.epochs // REPORTS) == 0:
            history.append(float(np.mean(losses)))
            losses = []
            on_epoch(step, config.epochs, history[-1])
    return history
