"""Training of predictors on opened flights, with the origin and the rotor lag that their files
carry.
"""

import dataclasses as dc
import itertools
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import torch

from np_drake.checks import require
from np_drake.flight_log import FlightLog
from np_drake.labels import RAW, LabelConfig, default_labels
from np_drake.lifting.model.lpv_model import LpvModel, units_of
from np_drake.lifting.training.excitation import excitation
from np_drake.lifting.training.neural_lpv import NeuralLpvConfig
from np_drake.lifting.training.paper_training import descend_once
from np_drake.lifting.training.train import Config, TrainingResult, configured, train
from np_drake.residual_models.motion_model import (
    GP,
    KNODE,
    GaussianProcessConfig,
    MotionModel,
    WrenchNetwork,
    fit_gaussian_process,
)
from np_drake.rotor_input import acting_command, with_rotor_lag
from np_drake.trained_model import origin_of, with_origin
from np_drake.training_data.accelerations import with_accelerations
from np_drake.training_data.actuator_timing import delayed, delays_sought, learned_timing
from np_drake.training_data.segments import Flight, WrenchSequence, finite_runs, group_scale
from np_drake.vehicle import Vehicle

TIMED = 10  # flights at most that tell how late commands act: more take long


def train_on_flights(
    flights: Sequence[Flight],
    config: Config,
    *,
    step: float,
    label: LabelConfig | None = None,
    on_epoch: Callable[[int, int, float], None] = lambda *_: None,
) -> TrainingResult:
    """Return the lifted linear system trained on `flights`, and its loss.

    Args:
        step: time between samples [s].
        label: low-pass of the labels, None for that of the vehicle.
        on_epoch: as of `train`.
    Raises: ValueError: if the flights are unusable.
    """
    vehicle, delays = flights[0].vehicle, [0.0]
    if isinstance(config, NeuralLpvConfig):
        label, delays = RAW, delays_sought(step)
        config = dc.replace(config, units=units_of(vehicle, step))
    timing = _timing(flights, delays)
    segments = []
    for f in flights:
        late = timing.get("command_delay", 0.0)
        data = delayed(f.data, late) if isinstance(f.data, FlightLog) else f.data
        lagging = with_rotor_lag(f.vehicle, timing["rotor_lag"])
        segments += Flight(data, lagging).segments(step, label)
    result = train(segments, config, on_epoch=on_epoch)
    origin = origin_of(flights[0].frame, vehicle, label or default_labels(vehicle))
    return dc.replace(result, model=with_origin(result.model, origin, **timing))


def _timing(flights: Sequence[Flight], delays: Sequence[float]) -> dict[str, float]:
    """Return how late commands act in the flights, by name.

    Args:
        delays: that are tried; of one alone, nothing is said.
    """
    told = [
        (with_accelerations(f.data), f.vehicle) for f in flights if isinstance(f.data, FlightLog)
    ]
    lag, delay = learned_timing(told[:TIMED], delays)
    return {"rotor_lag": lag} | ({"command_delay": delay} if len(delays) > 1 else {})


def fitted_lpv(prior: LpvModel, flights: Sequence[Flight], step: float) -> LpvModel:
    """Return the network for the vehicle of `flights`, with its units and the timing of its
    commands; what a payload does it has learnt from others.

    Args:
        step: time between samples [s].
    """
    vehicle = flights[0].vehicle
    summary = {**prior.summary, "samples": sum(len(flight.data) for flight in flights)}
    scale = np.repeat(units_of(vehicle, step), 3)
    model = dc.replace(prior, scale=scale, step=step, summary=summary)
    origin = origin_of(flights[0].frame, vehicle, RAW)
    return with_origin(model, origin, **_timing(flights, delays_sought(step)))


@dc.dataclass(frozen=True)
class Piece:
    """One uninterrupted piece of flight."""

    x: np.ndarray  # (n, 13)
    u: np.ndarray  # (n, 4) acting from each row to the next [N, N·m]
    step: float  # [s]


@dc.dataclass(frozen=True)
class KnodeConfig:
    """Parameters of the KNODE: network as Phi (two hidden layers of 128, ReLU), the rest own
    choice.
    """

    width: int = 128  # neurons of a hidden layer [1]
    layers: int = 2  # hidden layers [1]
    window: int = 10  # steps that are integrated from a measured state [1]
    spacing: int = 5  # samples between the starts of windows [1]
    batch: int = 60  # windows of a gradient step [1]
    epochs: int = 15  # passes over the windows [1]
    learning_rate: float = 4e-3  # of Adam, falling to a tenth along a cosine [1]
    weight_decay: float = 1e-5  # of AdamW [1]
    seed: int = 0  # of the initial weights and the order of windows


def fit_knode(
    pieces: Sequence[Piece],
    vehicle: Vehicle,
    config: KnodeConfig = KnodeConfig(),
    *,
    on_epoch: Callable[[int, int, float], None] = lambda *_: None,
) -> tuple[WrenchNetwork, list[float]]:
    """Return the trained network and the loss after each epoch; deterministic by `config.seed`.

    A loss of 1 is that of the nominal model.

    Args:
        on_epoch: called with (epoch, total, loss).
    Raises: ValueError: if no piece is longer than a window, or the steps differ.
    """
    x, u, step = _windows(pieces, config)
    scale = group_scale([piece.x[:, 7:13] for piece in pieces], centred=False)
    unit = np.concatenate([np.full(3, vehicle.mass), np.diag(vehicle.J)])  # of 1 m/s² and 1 rad/s²
    network = _Network(config, scale, unit)
    ode = _Nominal(vehicle, step)
    with torch.no_grad():
        missed = x[:, 1:, 7:] - ode.rollout(x[:, 0], u, lambda zeta: torch.zeros_like(zeta))
        # The constant that the nominal model misses most is known at once; descent need not look
        # for it.
        network.biases[-1].copy_(missed[:, -1].mean(dim=0) / (config.window * step))
        weight = 1.0 / missed.unflatten(-1, (2, 3)).pow(2).mean(dim=(0, 1, 3)).clamp_min(1e-12)
    optimiser = torch.optim.AdamW(
        network.parameters(), lr=config.learning_rate, weight_decay=config.weight_decay
    )
    rate = torch.optim.lr_scheduler.CosineAnnealingLR(
        optimiser, max(config.epochs, 1), config.learning_rate / 10
    )
    history = []
    for epoch in range(config.epochs):
        order = torch.from_numpy(np.random.default_rng([config.seed, epoch]).permutation(len(x)))
        losses = []
        for rows in order.split(config.batch):
            error = ode.rollout(x[rows, 0], u[rows], network) - x[rows, 1:, 7:]
            loss = (error.unflatten(-1, (2, 3)).pow(2).mean(dim=(0, 1, 3)) * weight).mean()
            descend_once(optimiser, loss)
            losses.append(loss.item())
        rate.step()
        history.append(float(np.mean(losses)))
        on_epoch(epoch + 1, config.epochs, history[-1])
    return network.export(), history


class _Network(torch.nn.Module):
    """Wrench network with gradients, in double precision."""

    def __init__(self, config: KnodeConfig, scale: np.ndarray, unit: np.ndarray):
        super().__init__()
        generator = torch.Generator().manual_seed(config.seed)
        sizes = list(itertools.pairwise([6] + [config.width] * config.layers + [6]))
        self.weights, self.biases = torch.nn.ParameterList(), torch.nn.ParameterList()
        for place, (inputs, outputs) in enumerate(sizes):
            gain = 0.0 if place == len(sizes) - 1 else np.sqrt(2.0 / inputs)  # starts as a constant
            raw = torch.randn(outputs, inputs, generator=generator, dtype=torch.float64)
            self.weights.append(torch.nn.Parameter(gain * raw))
            self.biases.append(torch.nn.Parameter(torch.zeros(outputs, dtype=torch.float64)))
        self._scale, self._unit = torch.from_numpy(scale), torch.from_numpy(unit)

    def forward(self, zeta: torch.Tensor) -> torch.Tensor:
        """Return chi (..., 6) [N, N·m]."""
        value = zeta / self._scale
        for W, b in zip(self.weights[:-1], self.biases[:-1], strict=True):
            value = torch.relu(value @ W.T + b)
        return (value @ self.weights[-1].T + self.biases[-1]) * self._unit

    def export(self) -> WrenchNetwork:
        """Return the network in numpy."""
        weights, biases = (
            tuple(p.detach().numpy().copy() for p in group) for group in (self.weights, self.biases)
        )
        return WrenchNetwork(weights, biases, self._scale.numpy().copy(), self._unit.numpy().copy())


class _Nominal:
    """Dynamics of eq. (1) of Jin et al. 2025 with gradients; classical Runge-Kutta, the input held
    over a step.
    """

    def __init__(self, vehicle: Vehicle, step: float):
        self._step, self._mass, self._gravity = step, vehicle.mass, vehicle.gravity
        self._J, self._J_inv = (
            torch.from_numpy(vehicle.J),
            torch.from_numpy(np.linalg.inv(vehicle.J)),
        )

    def rollout(self, start: torch.Tensor, u: torch.Tensor, wrench: Callable) -> torch.Tensor:
        """Return zeta after 1 … H steps, (b, H, 6).

        Args:
            start: (b, 13) states.
            u: (b, H, 4) commands [N, N·m].
        """
        y, course = start[:, 3:], []  # q, v, w: position drives nothing
        for i in range(u.shape[1]):
            y = self._advance(y, u[:, i], wrench)
            course.append(y[:, 4:])
        return torch.stack(course, dim=1)

    def _advance(self, y: torch.Tensor, u: torch.Tensor, wrench: Callable) -> torch.Tensor:
        h = self._step
        k1 = self._rate(y, u, wrench)
        k2 = self._rate(y + 0.5 * h * k1, u, wrench)
        k3 = self._rate(y + 0.5 * h * k2, u, wrench)
        k4 = self._rate(y + h * k3, u, wrench)
        return y + (h / 6) * (k1 + 2 * k2 + 2 * k3 + k4)

    def _rate(self, y: torch.Tensor, u: torch.Tensor, wrench: Callable) -> torch.Tensor:
        (q0, q1, q2, q3), w, chi = y[:, :4].T, y[:, 7:], wrench(y[:, 4:])
        a, b, c = w.T
        dq = 0.5 * torch.stack(
            [
                -q1 * a - q2 * b - q3 * c,
                q0 * a + q2 * c - q3 * b,
                q0 * b + q3 * a - q1 * c,
                q0 * c + q1 * b - q2 * a,
            ],
            dim=1,
        )
        up = torch.stack(
            [2 * (q1 * q3 + q0 * q2), 2 * (q2 * q3 - q0 * q1), q0**2 - q1**2 - q2**2 + q3**2], dim=1
        )
        dv = (u[:, :1] * up + chi[:, :3]) / self._mass
        dv = dv - torch.tensor([0.0, 0.0, self._gravity], dtype=dv.dtype)
        torque = u[:, 1:] + chi[:, 3:] - torch.linalg.cross(w, w @ self._J.T)
        return torch.cat([dq, dv, torque @ self._J_inv.T], dim=1)


def _windows(
    pieces: Sequence[Piece], config: KnodeConfig
) -> tuple[torch.Tensor, torch.Tensor, float]:
    """Return x (m, H + 1, 13), u (m, H, 4) and the step [s]."""
    steps = np.array([piece.step for piece in pieces])
    if len(steps) and np.ptp(steps) > 0.02 * steps.min():
        raise ValueError(
            f"knode: all logs must share one step [s]; got {steps.min()} to {steps.max()}."
        )
    H = config.window
    starts = [(p, k) for p in pieces for k in range(0, len(p.x) - H, config.spacing)]
    require(starts, f"knode: at least {H + 1} rows in one piece are needed; got none so long.")
    x = np.array([piece.x[k : k + H + 1] for piece, k in starts])
    u = np.array([piece.u[k : k + H] for piece, k in starts])
    return torch.from_numpy(x), torch.from_numpy(u), float(steps[0])


CONFIGURATIONS: dict[str, GaussianProcessConfig | KnodeConfig] = {
    GP: GaussianProcessConfig(),
    KNODE: KnodeConfig(),
}


def train_motion_model(
    name: str,
    flights: Sequence[Flight],
    *,
    step: float,
    label: LabelConfig | None = None,
    on_epoch: Callable[[int, int, float], None] = lambda *_: None,
    **settings,
) -> tuple[MotionModel, list[float]]:
    """Return the model called `name` (gp or knode) and its loss after each epoch (none in closed
    form).

    Args:
        step: time between samples in flight [s].
        label: low-pass of the labels, None for the default.
        on_epoch: called with (epoch, total, loss).
        settings: of the configuration, `seed` among them.
    Raises: ValueError: on an unknown name or setting, or flights that the model cannot learn from.
    """
    config, vehicle = configured(CONFIGURATIONS, name, settings), flights[0].vehicle
    require(
        all(flight.vehicle == vehicle for flight in flights),
        f"{name}: all flights must be of one vehicle; give them one --vehicle FILE.",
    )
    segments = [piece for flight in flights for piece in flight.segments(step, label)]
    loss: list[float] = []
    if isinstance(config, GaussianProcessConfig):
        reaction: Any = fit_gaussian_process(segments, config)
    else:
        reaction, loss = fit_knode(_pieces(flights), vehicle, config, on_epoch=on_epoch)
    error = np.concatenate([reaction(s.zeta) - s.goal for s in segments])
    summary = {
        "samples": sum(map(len, segments)),
        "loss": loss[-1] if loss else None,
        "label_rmse": np.sqrt(np.mean(error**2, axis=0)).tolist(),
        "excitation": excitation(segments),
        "settings": dc.asdict(config),
    }
    model = MotionModel(name, reaction, step, summary)
    origin = origin_of(flights[0].frame, vehicle, label or default_labels(vehicle))
    return with_origin(model, origin), loss


def _pieces(flights: Sequence[Flight]) -> list[Piece]:
    """Return the pieces of logs between rows that hold a NaN, with the command that acts by the
    vehicle's rotor lag.
    """
    pieces = []
    for flight in flights:
        log = flight.data
        if isinstance(log, WrenchSequence):
            raise ValueError(f"knode: {log.name} holds no command to integrate; give flight logs.")
        x, u = log.x, acting_command(log, flight.vehicle)
        pieces += [Piece(x[a:b], u[a:b], log.step) for a, b in finite_runs(x, u)]
    return pieces
