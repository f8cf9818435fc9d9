"""Training of predictors on opened flights, with the origin and the rotor lag that their files
carry.
"""

import dataclasses as dc
import itertools
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import numpy as np
import torch

from np_drake.checks import require
from np_drake.flight_log import FlightLog
from np_drake.labels import RAW, LabelConfig, default_labels
from np_drake.lifting.model.lpv_model import NEURAL_LPV, LpvModel, units_of
from np_drake.lifting.training import OnEpoch
from np_drake.lifting.training.excitation import excitation
from np_drake.lifting.training.neural_lpv import NeuralLpvConfig, fine_tuned
from np_drake.lifting.training.paper_training import descend
from np_drake.lifting.training.train import Config, TrainingResult, configured, make_config, train
from np_drake.residual_models.motion_model import (
    GP,
    KNODE,
    GaussianProcessConfig,
    MotionModel,
    WrenchNetwork,
    fit_gaussian_process,
)
from np_drake.rigid_body import runge_kutta
from np_drake.rotor_input import acting_command, with_rotor_lag
from np_drake.trained_model import Perceptron, origin_of, with_origin
from np_drake.training_data.accelerations import with_accelerations
from np_drake.training_data.actuator_timing import delayed, delays_sought, learned_timing
from np_drake.training_data.segments import Flight, Segment, finite_runs, group_scale
from np_drake.vehicle import Vehicle

TIMED = 10  # flights at most that tell how late commands act: more take long


def train_on_flights(
    flights: Sequence[Flight],
    config: Config,
    *,
    step: float,
    label: LabelConfig | None = None,
    on_epoch: OnEpoch = lambda *_: None,
) -> TrainingResult:
    """Return the lifted linear system trained on `flights`, and its loss.

    Args:
        step: time between samples [s].
        label: low-pass of the labels, None for that of the vehicle.
        on_epoch: as of `train`.
    Raises: ValueError: if the flights are unusable.
    """
    vehicle = flights[0].vehicle
    delays = [0.0]
    if isinstance(config, NeuralLpvConfig):
        label = RAW
        delays = delays_sought(step)
        config = dc.replace(config, units=units_of(vehicle, step))
    timing = _timing(flights, delays)
    result = train(_segments(flights, timing, step, label), config, on_epoch=on_epoch)
    origin = origin_of(flights[0].frame, vehicle, label or default_labels(vehicle))
    return dc.replace(result, model=with_origin(result.model, origin, **timing))


def _segments(
    flights: Sequence[Flight], timing: dict[str, float], step: float, label: LabelConfig | None
) -> list[Segment]:
    """Return the pieces of the flights, of commands that act as late as `timing` says."""
    segments = list[Segment]()
    for f in flights:
        late = timing.get("command_delay", 0.0)
        data = delayed(f.data, late) if isinstance(f.data, FlightLog) else f.data
        vehicle = with_rotor_lag(f.vehicle, timing["rotor_lag"])
        segments += Flight(data, vehicle).segments(step, label)
    return segments


def _timing(flights: Sequence[Flight], delays: Sequence[float]) -> dict[str, float]:
    """Return how late commands act in the flights, by name.

    Args:
        delays: that are tried; of one alone, nothing is said.
    """
    logs = [
        (with_accelerations(f.data), f.vehicle)
        for f in flights[:TIMED]
        if isinstance(f.data, FlightLog)
    ]
    lag, delay = learned_timing(logs, delays)
    return {"rotor_lag": lag} | ({"command_delay": delay} if len(delays) > 1 else {})


def _one_vehicle(name: str, flights: Sequence[Flight]) -> Vehicle:
    """Return the vehicle of the flights that the predictor `name` is trained on.

    Raises: ValueError: if they are of several.
    """
    vehicle = flights[0].vehicle
    require(
        all(flight.vehicle == vehicle for flight in flights),
        f"{name}: all flights must be of one vehicle; give them one --vehicle FILE.",
    )
    return vehicle


def fitted_lpv(
    prior: Any,
    flights: Sequence[Flight],
    step: float,
    *,
    epochs: int = 0,
    on_epoch: OnEpoch = lambda *_: None,
) -> LpvModel:
    """Return the network for the vehicle of `flights`, with its units and the timing of its
    commands; what a payload does it has learnt from others, and from these in `epochs` more steps.

    Args:
        prior: an `LpvModel`.
        step: time between samples [s].
        epochs: gradient steps on the flights, see `fine_tuned`.
        on_epoch: as of `train`.
    """
    vehicle = _one_vehicle(NEURAL_LPV, flights)
    summary = {"samples": sum(len(flight.data) for flight in flights), "prior": prior.summary}
    unit = np.repeat(units_of(vehicle, step), 3)
    model = dc.replace(prior, scale=unit, step=step, summary=summary)
    make_config(NEURAL_LPV, frame=flights[0].frame)  # refuses other axes
    timing = _timing(flights, delays_sought(step))
    if epochs:
        pieces = _segments(flights, timing, step, RAW)
        model = fine_tuned(model, pieces, epochs=epochs, on_epoch=on_epoch)
    return with_origin(model, origin_of(flights[0].frame, vehicle, RAW), **timing)


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
    logs: Sequence[FlightLog],
    vehicle: Vehicle,
    config: KnodeConfig = KnodeConfig(),
    *,
    on_epoch: OnEpoch = lambda *_: None,
) -> tuple[WrenchNetwork, list[float]]:
    """Return the trained network and the loss after each epoch; deterministic by `config.seed`.

    A loss of 1 is that of the nominal model.

    Args:
        on_epoch: called with (epoch, total, loss).
    Raises: ValueError: if no piece is longer than a window, or the steps differ.
    """
    steps = np.array([log.step for log in logs])
    require(
        np.ptp(steps) <= 0.02 * steps.min(),
        f"knode: all logs must share one step [s]; got {steps.min()} to {steps.max()}.",
    )
    x, u, scale = _windows(logs, vehicle, config)
    unit = np.concatenate([np.full(3, vehicle.mass), np.diag(vehicle.J)])  # of 1 m/s² and 1 rad/s²
    network = _initial_network(config)
    tried = WrenchNetwork(network, torch.from_numpy(scale), torch.from_numpy(unit))
    roll = partial(rollout, vehicle, float(steps[0]))
    with torch.no_grad():
        missed = x[:, 1:, 7:] - roll(x[:, 0], u, torch.zeros_like)
        # The constant that the nominal model misses most is known at once; descent need not look
        # for it.
        network.biases[-1].copy_(missed[:, -1].mean(dim=0) / (config.window * steps[0]))
        weight = 1.0 / missed.unflatten(-1, (2, 3)).pow(2).mean(dim=(0, 1, 3)).clamp_min(1e-12)

    def loss(rows: torch.Tensor) -> torch.Tensor:
        error = roll(x[rows, 0], u[rows], tried) - x[rows, 1:, 7:]
        return (error.unflatten(-1, (2, 3)).pow(2).mean(dim=(0, 1, 3)) * weight).mean()

    optimiser = torch.optim.AdamW(
        [*network.weights, *network.biases],
        lr=config.learning_rate,
        weight_decay=config.weight_decay,
    )
    history = descend(optimiser, loss, len(x), config, on_epoch=on_epoch)
    return WrenchNetwork(network.in_numpy(), scale, unit), history


def _initial_network(config: KnodeConfig) -> Perceptron:
    """Return a random network of tensors with gradients that starts as a constant."""
    generator = torch.Generator().manual_seed(config.seed)
    weights = []
    for inputs, outputs in itertools.pairwise([6, *[config.width] * config.layers, 6]):
        raw = torch.randn(outputs, inputs, generator=generator, dtype=torch.float64)
        weights.append(np.sqrt(2.0 / inputs) * raw)
    weights[-1].zero_()
    biases = [torch.zeros(len(W), dtype=W.dtype) for W in weights]
    for value in (*weights, *biases):
        value.requires_grad_()
    return Perceptron(tuple(weights), tuple(biases))


def rollout(
    vehicle: Vehicle, step: float, start: torch.Tensor, u: torch.Tensor, wrench: Callable
) -> torch.Tensor:
    """Return zeta after 1 … H steps of eq. (1) of Jin et al. 2025, (b, H, 6); classical
    Runge-Kutta, the input held over a step.

    Args:
        step: [s].
        start: (b, 13) states.
        u: (b, H, 4) commands [N, N·m].
        wrench: chi (b, 6) at zeta (b, 6).
    """
    # q, v, w: position drives nothing
    y = start[:, 3:]
    course = []
    for command in u.unbind(dim=1):
        y = runge_kutta(partial(_rate, vehicle, wrench, command), y, step)
        course.append(y[:, 4:])
    return torch.stack(course, dim=1)


def _rate(vehicle: Vehicle, wrench: Callable, u: torch.Tensor, y: torch.Tensor) -> torch.Tensor:
    q0, q1, q2, q3 = y[:, :4].T
    w = y[:, 7:]
    chi = wrench(y[:, 4:])
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
    dv = (u[:, :1] * up + chi[:, :3]) / vehicle.mass
    dv = dv - torch.tensor([0.0, 0.0, vehicle.gravity], dtype=dv.dtype)
    torque = u[:, 1:] + chi[:, 3:] - torch.linalg.cross(w, w @ torch.from_numpy(vehicle.J).T)
    return torch.cat([dq, dv, torque @ torch.from_numpy(np.linalg.inv(vehicle.J)).T], dim=1)


def _windows(
    logs: Sequence[FlightLog], vehicle: Vehicle, config: KnodeConfig
) -> tuple[torch.Tensor, torch.Tensor, np.ndarray]:
    """Return x (m, H + 1, 13) and u (m, H, 4) of windows between the rows that hold a NaN, with the
    command that acts by the vehicle's rotor lag, and the scale (6,) of zeta.
    """
    pieces = list[tuple[np.ndarray, np.ndarray]]()
    for log in logs:
        x = log.x
        u = acting_command(log, vehicle)
        pieces += [(x[a:b], u[a:b]) for a, b in finite_runs(x, u)]
    H = config.window
    starts = [(x, u, k) for x, u in pieces for k in range(0, len(x) - H, config.spacing)]
    require(starts, f"knode: at least {H + 1} rows in one piece are needed; got none so long.")
    states = np.array([x[k : k + H + 1] for x, _, k in starts])
    commands = np.array([u[k : k + H] for _, u, k in starts])
    scale = group_scale([x[:, 7:13] for x, _ in pieces], centred=False)
    return torch.from_numpy(states), torch.from_numpy(commands), scale


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
    on_epoch: OnEpoch = lambda *_: None,
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
    config = configured(CONFIGURATIONS, name, settings)
    vehicle = _one_vehicle(name, flights)
    segments = [piece for flight in flights for piece in flight.segments(step, label)]
    loss: list[float] = []
    if isinstance(config, GaussianProcessConfig):
        reaction: Any = fit_gaussian_process(segments, config)
    else:
        logs = [flight.data for flight in flights if isinstance(flight.data, FlightLog)]
        require(
            len(logs) == len(flights),
            "knode: arrays hold no command to integrate; give flight logs.",
        )
        reaction, loss = fit_knode(logs, vehicle, config, on_epoch=on_epoch)
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
