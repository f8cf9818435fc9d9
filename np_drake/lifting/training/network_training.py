"""Training of `neural`: a network on top of a trained family of lifted linear systems.

The loss is the mean over flights and horizons of the square error of the forecast force over that
of persistence, as of the family, which stays as it is; theta is as estimated along each flight. The
last layer starts at zero, so that the descent starts from the family's own forecasts. Most flights
are descended on, some say when to stop, and on others, which neither has seen, the share of the
correction is chosen: none where it does not help.
"""

import copy
import dataclasses as dc
import itertools
from collections.abc import Sequence

import numpy as np
import torch
from torch import nn

from np_drake.lifting.model.adaptive_family import AdaptiveFamily
from np_drake.lifting.model.lifted_model import NEURAL, LiftedModel
from np_drake.lifting.model.neural_family import (
    NeuralFamily,
    WindowNetwork,
    images,
    saturated,
    with_network,
)
from np_drake.lifting.training import OnEpoch
from np_drake.lifting.training.family_training import (
    LiftedConfig,
    descend_once,
    readouts,
    single,
    train_lifted,
)
from np_drake.lifting.training.paper_training import normalised
from np_drake.training_data.segments import Segment

HORIZONS = (2, 5, 10, 20, 40)  # of the loss, up to that of the controller [steps]


@dc.dataclass(frozen=True)
class AxisWindows:
    """Windows as one axis sees them, n, with what their forecasts need, scaled.

    seen: (n, V, m) principal components.
    lifted: (n, V, K, 1 + r) what each entry of [1, theta] multiplies in z. coming: (n, V, H, c - 1)
        inputs.
    goal: (n, V, h) force at the horizons.
    """

    seen: torch.Tensor
    lifted: torch.Tensor
    coming: torch.Tensor
    goal: torch.Tensor


@dc.dataclass(frozen=True)
class FamilyWindows:
    """Windows of flights.

    theta: (n, r) as estimated at each.
    weight: (n, h) of square errors, whose sum then is the mean over flights and horizons of the
        square error over that of persistence.
    """

    family: AdaptiveFamily
    step: float
    axes: list[AxisWindows]
    theta: torch.Tensor
    weight: torch.Tensor

    def __len__(self) -> int:
        return len(self.theta)

    @property
    def inputs(self) -> torch.Tensor:
        """What a network sees of the windows, (n, i), without theta."""
        return torch.cat([axis.seen.flatten(1) for axis in self.axes], dim=1)

    @property
    def size(self) -> np.ndarray:
        """Root mean square of z, over windows and views, (K,)."""
        at, sizes = torch.cat([torch.ones(len(self), 1), self.theta], dim=1), []
        for axis in self.axes:
            power = torch.einsum("nvkr,nr->nvk", axis.lifted, at).square().mean((0, 1))
            sizes.append(power.sqrt().repeat(axis.lifted.shape[1]))
        return torch.cat(sizes).numpy().astype(float)

    def some(self, numbers: torch.Tensor) -> "FamilyWindows":
        """Return the windows with these numbers."""
        axes = [
            AxisWindows(**{f.name: getattr(a, f.name)[numbers] for f in dc.fields(a)})
            for a in self.axes
        ]
        return dc.replace(self, axes=axes, theta=self.theta[numbers], weight=self.weight[numbers])

    def loss(self, dz: torch.Tensor, change: torch.Tensor) -> torch.Tensor:
        """Return the weighted sum of square errors.

        Args:
            dz: (n, K) that is added to z.
            change: (n, r) that is added to theta.
        """
        at, first = torch.cat([torch.ones(len(self), 1), self.theta + change], dim=1), 0
        square = torch.zeros_like(self.weight)
        for axis, own in zip(self.family.axes, self.axes, strict=True):
            V, K = own.lifted.shape[1:3]
            added = dz[:, first : first + V * K].reshape(-1, V, K)
            first += V * K
            frequency, damping, decay = (
                single(part) for part in (axis.frequency, axis.damping, axis.decay)
            )
            CA = readouts(at, frequency, damping, decay, self.step * torch.arange(HORIZONS[-1] + 1))
            z = torch.einsum("nvkr,nr->nvk", own.lifted, at) + added
            response = CA[..., :-1].mT @ torch.einsum(
                "kcr,nr->nkc", single(axis.inputs), at
            )  # (n, H, c - 1)
            # Input j acts on the force h steps ahead through C A^(h-1-j) B
            driven = [
                torch.einsum("nhc,nvhc->nv", response[:, :h].flip(1), own.coming[:, :, :h])
                for h in HORIZONS
            ]
            error = (
                torch.einsum("nvk,nkh->nvh", z, CA[..., list(HORIZONS)])
                + torch.stack(driven, -1)
                - own.goal
            )
            square = square + error.square().sum(1)
        return (self.weight * square).sum()


def family_windows(
    family: AdaptiveFamily,
    white: Sequence[np.ndarray],
    flights: Sequence[Segment],
    *,
    step: float,
    count: int,
    noise: float,
) -> FamilyWindows:
    """Return windows of flights, evenly spaced along each.

    Args:
        white: (m, D c) of each axis, maps its views' windows to principal components.
        flights: each longer than a window and the longest horizon.
        step: [s].
        noise: deviation of the labels' white noise; persistence errs at least by it [scaled].
    """
    rows = [_of_flight(family, white, flight, step, count, noise) for flight in flights]
    axes = [
        AxisWindows(*(torch.cat(part) for part in zip(*own, strict=True)))
        for own in zip(*(row[0] for row in rows), strict=True)
    ]
    theta, weight = torch.cat([row[1] for row in rows]), torch.cat([row[2] for row in rows])
    return FamilyWindows(family, step, axes, theta, weight / len(flights))


def principal_components(
    family: AdaptiveFamily, flights: Sequence[Segment], count: int, every: int = 20
) -> list[np.ndarray]:
    """Return for each axis the map of a view's window to its largest principal components, of unit
    mean square.

    Args:
        family: whose axes see the windows.
    """
    grams: list[np.ndarray] = []
    total = 0
    for flight in flights:
        windows = _windows(flight, family.delay)[::every]
        seen = [s.reshape(-1, s.shape[-1]) for s in family.seen(windows)]
        own = [s.T @ s / (len(s) / len(windows)) for s in seen]
        grams = [a + b for a, b in zip(grams, own, strict=True)] if grams else own
        total += len(windows)
    white = []
    for gram in grams:
        power, directions = np.linalg.eigh(gram / total)
        power, directions = power[::-1][:count], directions[:, ::-1][:, :count]
        white.append((directions / np.sqrt(np.maximum(power, 1e-9 * power[0]))).T)
    return white


def _of_flight(
    family: AdaptiveFamily,
    white: Sequence[np.ndarray],
    flight: Segment,
    step: float,
    count: int,
    noise: float,
) -> tuple[list[tuple[torch.Tensor, ...]], torch.Tensor, torch.Tensor]:
    """Return what `AxisWindows` hold of one flight, theta and weights."""
    H, samples = HORIZONS[-1], np.hstack([flight.chi, flight.zeta])
    starts = np.arange(len(flight) - family.delay - H + 1)
    starts = starts[:: max(1, -(-len(starts) // count))]
    now, ahead = starts + family.delay - 1, np.array(HORIZONS)
    theta = family.thetas(samples, step)[starts]
    parts, power = [], np.full(len(ahead), noise**2 * 3)
    for axis, seen, W in zip(
        family.axes, family.seen(_windows(flight, family.delay)[starts]), white, strict=True
    ):
        lifted = (seen @ axis.by_theta).reshape(*seen.shape[:2], axis.K, -1)
        coming = axis.seen(samples)[:, now[:, None] + np.arange(H), 1:].swapaxes(0, 1)
        toward = np.linalg.pinv(axis.readout)  # (6, V)
        goal = np.moveaxis((flight.goal @ toward)[now[:, None] + ahead], 1, 2)
        still = goal - (flight.chi @ toward)[now][..., None]
        power += np.mean(np.sum(still**2, axis=1), axis=0)
        parts.append(tuple(single(part) for part in (seen @ W.T, lifted, coming, goal)))
    weight = np.tile(1.0 / (power * len(ahead) * len(now)), (len(now), 1))
    return parts, single(theta), single(weight)


def _windows(flight: Segment, delay: int) -> np.ndarray:
    """Return every window of a flight, (n - D + 1, D, 12), oldest sample first."""
    samples = np.hstack([flight.chi, flight.zeta])
    return np.lib.stride_tricks.sliding_window_view(samples, delay, axis=0).swapaxes(1, 2)


SHARES = (0.0, 0.25, 0.5, 0.75, 1.0)  # of the correction, that are compared [1]
# one flight of so many says when to stop, and another one judges; fewer train no network [1]
PART = 10
CHECKS = 20  # of the descent [1]
JUDGED = 80  # windows of a flight that judges [1]


@dc.dataclass(frozen=True)
class NeuralConfig(LiftedConfig):
    """Parameters of `neural`: those of its family, and of the network."""

    width: int = 64  # of two hidden layers [1]
    components: int = 12  # of each view's window that the network sees [1]
    gain: float = 3.0  # largest singular value of a hidden layer, in scaled inputs [1]
    flights: int = 500  # that the network is trained on, drawn from all [1]
    windows: int = 80  # of a flight [1]
    updates: int = 2000  # of its descent [1]
    group: int = 512  # windows of an update [1]
    learning: float = 5e-3  # its rate, falling to a hundredth along a cosine [1]
    decay: float = 1e-2  # of the weights, times the rate [1]


def train_neural(
    segments: list[Segment], config: NeuralConfig, on_epoch: OnEpoch
) -> tuple[LiftedModel, list[float]]:
    """Return (model, loss of the family after each step) of the `neural` configuration.

    Args:
        on_epoch: called after each step of the family, and of the network.
    """
    total = config.steps + config.updates
    _split(segments, config)
    model, losses = train_lifted(segments, config, lambda n, _, loss: on_epoch(n, total, loss))
    return add_network(
        model, segments, config, lambda n, _, loss: on_epoch(config.steps + n, total, loss)
    ), losses


def add_network(
    model: LiftedModel,
    segments: Sequence[Segment],
    config: NeuralConfig,
    on_epoch: OnEpoch = lambda *_: None,
) -> LiftedModel:
    """Return the model of a family with a network on top, which is trained on flights.

    Args:
        segments: flights of its training; short ones are left out.
    Raises: ValueError: where they are too few.
    """
    family = model.encoder
    assert isinstance(family, AdaptiveFamily)
    judge, stop, rest = _split(segments, config)
    white = principal_components(family, rest, config.components)
    descended, stopping = (
        family_windows(
            family, white, flights, step=model.step, count=config.windows, noise=config.label_noise
        )
        for flights in (rest, stop)
    )
    module = _Module(family, white, descended.size, config)
    _descend(module, descended, stopping, config, on_epoch)
    neural = judged(
        dc.replace(model, configuration=NEURAL, encoder=with_network(family, module.export())),
        judge,
    )
    assert isinstance(neural.encoder, NeuralFamily)
    network = neural.encoder.network
    told = {
        "flights": len(rest),
        "share": network.share,
        "lipschitz_bound": round(network.lipschitz_bound, 3),
    }
    return dc.replace(neural, summary={**neural.summary, "network": told})


def judged(model: LiftedModel, segments: Sequence[Segment]) -> LiftedModel:
    """Return the model with the share of its network's correction that foresees flights best, its
    own at most.

    Args:
        model: any; one without network, or flights all shorter than a window and a forecast, change
            nothing.
    """
    family, long = model.encoder, _long(segments, model.window)
    if not isinstance(family, NeuralFamily) or not long:
        return model
    network = family.network
    data = family_windows(
        family, network.white, long, step=model.step, count=JUDGED, noise=LiftedConfig.label_noise
    )
    x = saturated(
        np.concatenate([data.inputs, (data.theta - network.center) / network.spread], axis=1)
    )
    dz, change = (torch.from_numpy(part).float() for part in network.correction(x))
    losses = [float(data.loss(share * dz, share * change)) for share in SHARES]
    share = network.share * SHARES[int(np.argmin(losses))]
    return dc.replace(model, encoder=with_network(family, dc.replace(network, share=share)))


class _Module(nn.Module):
    """The network as it is trained, its hidden weights normalised."""

    def __init__(
        self,
        family: AdaptiveFamily,
        white: Sequence[np.ndarray],
        size: np.ndarray,
        config: NeuralConfig,
    ):
        super().__init__()
        generator, r = torch.Generator().manual_seed(config.seed), len(family.mean)
        self._white, self._size, self._gain = tuple(white), size, config.gain
        self._states = tuple((len(axis.channels), axis.K) for axis in family.axes)
        self._center, self._spread = family.mean, np.sqrt(np.diag(family.covariance))
        seen = [(views, len(W)) for (views, _), W in zip(self._states, white, strict=True)]
        sizes = [sum(views * count for views, count in seen) + r, config.width, config.width]
        hidden = [torch.randn(o, i, generator=generator) for i, o in itertools.pairwise(sizes)]
        self.hidden = nn.ParameterList(nn.Parameter(W / W.shape[1] ** 0.5) for W in hidden)
        self.last = nn.Parameter(torch.zeros(family.K + r, config.width))
        self.biases = nn.ParameterList(
            nn.Parameter(torch.zeros(n)) for n in (*sizes[1:], family.K + r)
        )
        before, after = images(seen, r), images(list(self._states), r)
        self._images = [
            (torch.from_numpy(a).float(), torch.from_numpy(b).float())
            for a, b in zip(before, after, strict=True)
        ]
        self._unit = torch.from_numpy(np.concatenate([size, self._spread])).float()
        self._scaled = [torch.from_numpy(array).float() for array in (self._center, self._spread)]

    def forward(
        self, data: FamilyWindows, image: int | None = None
    ) -> tuple[torch.Tensor, torch.Tensor]:
        """Return dz (n, K) and dtheta (n, r), of one turn or mirror image, or the mean over all."""
        center, spread = self._scaled
        x = saturated(torch.cat([data.inputs, (data.theta - center) / spread], dim=1))
        some = self._images if image is None else [self._images[image]]
        weights, outputs = (
            [normalised(W, self._gain) for W in self.hidden],
            torch.zeros(len(x), len(self._unit)),
        )
        for before, after in some:
            h = x @ before.T
            for W, b in zip(weights, self.biases, strict=False):
                h = nn.functional.silu(h @ W.T + b)
            outputs = outputs + (h @ self.last.T + self.biases[-1]) @ after
        outputs = outputs / len(some) * self._unit
        K = len(self._size)
        return outputs[:, :K], outputs[:, K:]

    def export(self) -> WindowNetwork:
        """Return the network in numpy, all of its correction used."""
        hidden = [normalised(W, self._gain) for W in self.hidden]
        weights = tuple(W.detach().numpy().astype(float) for W in (*hidden, self.last))
        biases = tuple(b.detach().numpy().astype(float) for b in self.biases)
        return WindowNetwork(
            self._white, self._states, weights, biases, self._center, self._spread, self._size, 1.0
        )


def _descend(
    module: _Module,
    data: FamilyWindows,
    stopping: FamilyWindows,
    config: NeuralConfig,
    on_epoch: OnEpoch,
) -> None:
    """Train on `data`, and leave the weights that foresaw `stopping` best."""
    optimiser = torch.optim.AdamW(
        module.parameters(), lr=config.learning, weight_decay=config.decay
    )
    schedule = torch.optim.lr_scheduler.CosineAnnealingLR(
        optimiser, config.updates, eta_min=0.01 * config.learning
    )
    generator = torch.Generator().manual_seed(config.seed)
    best, kept, every = np.inf, copy.deepcopy(module.state_dict()), max(1, config.updates // CHECKS)
    for number in range(config.updates):
        some = data.some(torch.randint(len(data), (config.group,), generator=generator))
        turn = int(torch.randint(8, (1,), generator=generator))
        loss = some.loss(*module(some, turn)) * (len(data) / config.group)
        descend_once(optimiser, loss)
        schedule.step()
        on_epoch(number + 1, config.updates, loss.item())
        if number % every == 0 or number == config.updates - 1:
            with torch.no_grad():
                now = float(stopping.loss(*module(stopping)))
            if now < best:
                best, kept = now, copy.deepcopy(module.state_dict())
    module.load_state_dict(kept)


def _split(
    segments: Sequence[Segment], config: NeuralConfig
) -> tuple[list[Segment], list[Segment], list[Segment]]:
    """Return the flights that judge, that say when to stop, and that are descended on."""
    long = _long(segments, config.delay + max(config.lags))
    drawn = [
        long[i] for i in np.random.default_rng(config.seed).permutation(len(long))[: config.flights]
    ]
    part = len(drawn) // PART
    if part == 0:
        raise ValueError(
            f"neural: at least {PART} flights are needed; got {len(drawn)}. Use lifted."
        )
    return drawn[:part], drawn[part : 2 * part], drawn[2 * part :]


def _long(segments: Sequence[Segment], window: int) -> list[Segment]:
    return [segment for segment in segments if len(segment) > window + HORIZONS[-1]]
