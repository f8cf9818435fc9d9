"""Windows of flights as a family of lifted linear systems sees them, and its forecasts from
corrected z and theta.
"""

import dataclasses as dc
from collections.abc import Sequence

import numpy as np
import torch

from np_drake.lifting.model.adaptive_family import AdaptiveFamily
from np_drake.lifting.training.family_axis import readouts
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
                _single(part) for part in (axis.frequency, axis.damping, axis.decay)
            )
            CA = readouts(at, frequency, damping, decay, self.step * torch.arange(HORIZONS[-1] + 1))
            z = torch.einsum("nvkr,nr->nvk", own.lifted, at) + added
            response = CA[..., :-1].mT @ torch.einsum(
                "kcr,nr->nkc", _single(axis.inputs), at
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
        parts.append(tuple(_single(part) for part in (seen @ W.T, lifted, coming, goal)))
    weight = np.tile(1.0 / (power * len(ahead) * len(now)), (len(now), 1))
    return parts, _single(theta), _single(weight)


def _windows(flight: Segment, delay: int) -> np.ndarray:
    """Return every window of a flight, (n - D + 1, D, 12), oldest sample first."""
    samples = np.hstack([flight.chi, flight.zeta])
    return np.lib.stride_tricks.sliding_window_view(samples, delay, axis=0).swapaxes(1, 2)


def _single(values: np.ndarray) -> torch.Tensor:
    return torch.from_numpy(np.ascontiguousarray(values)).float()
