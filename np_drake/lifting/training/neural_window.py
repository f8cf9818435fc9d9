"""Training of the `neural-window` configuration: a network beside a linear encoder of the window.

    eta = E w,   z = eta + W3 relu(W2 relu(W1 eta)),   z+ = A z + B zeta,   chi_hat = C z

A vehicle that hovers is the same in x and y, and left to right. So x and y have one law, z
another, and the network is averaged over quarter turns and mirrors; this holds at yaw near zero.
The torque about z is held.

E, A, B, C begin as the linear system that subspace identification finds. Then all of them and the
network descend on the error of forecasts of chi, from one step to the horizon ahead, along the
motion as it was flown.       Source: own choice; the encoder of a window as in delay-coordinate
Koopman models, W1 and W2 spectrally normalised as in Jin et al. 2025, eq. (sn).
"""

import dataclasses as dc
from collections.abc import Sequence

import numpy as np
import torch
from numpy.lib.stride_tricks import sliding_window_view

from np_drake.lifting.model.lifted_linear_system import Encoder, LiftedLinearSystem, Taps
from np_drake.lifting.model.lifted_model import NEURAL_WINDOW, LiftedModel
from np_drake.lifting.training import OnEpoch
from np_drake.lifting.training.excitation import excitation, turns
from np_drake.lifting.training.paper_training import (
    descend_once,
    foreseeing,
    global_fit,
    normalised,
    perceptron,
    stable,
)
from np_drake.training_data.segments import Segment, check_segments, group_scale

# Channels of [chi, zeta] that move together, and the sign with which they do in that of x
X = {0: 1.0, 4: 1.0, 6: 1.0, 10: 1.0}  # f_x, tau_y, v_x, w_y
Y = {1: 1.0, 3: -1.0, 7: 1.0, 9: -1.0}
Z = {2: 1.0, 8: 1.0}  # f_z, v_z
FITTED = 20_000  # origins of the linear fit, thinned beyond [1]
REPORTS = 20  # of the loss in a training [1]


@dc.dataclass(frozen=True)
class NeuralWindowConfig:
    """Parameters of the `neural-window` configuration."""

    sway: int = 9  # lifted states of x, and as many of y [1]
    heave: int = 6  # of z [1]
    width: int = 128  # neurons of each of the two hidden layers [1]
    delay: int = 50  # samples the encoder sees [1]
    dense: int = 10  # of them one by one, the newest [1]
    averages: int = 8  # the others in so many averages [1]
    horizon: int = 40  # longest forecast that is trained on [steps]
    refit: int = 40  # samples that A and B are fitted to in flight [1]
    ridge: float = 3000.0  # of the offline A and B in that fit [samples of unit size]
    # gradient steps [1]; own choice: more learn a minute of flight by heart, noise and all
    epochs: int = 300
    batch: int = 128  # forecasts of a step [1]
    learning_rate: float = 5e-4  # of Adam, falling to a tenth along a cosine [1]
    seed: int = 0  # of the initial weights and the forecasts of each step

    @property
    def taps(self) -> Taps:
        """Samples and averages that the encoder sees."""
        return Taps.averaging(self.delay, self.dense, self.averages)


class Motion:
    """Linear system of channels that move together, one for each of `planes`, all of one law.

    It begins as subspace identification finds it.

    Args:
        size: lifted states.
        planes: channels of [chi, zeta] and their signs.
        windows: (n, delay + horizon, 12) of [chi, zeta], scaled.
        taps: of the encoder.
    """

    def __init__(
        self, size: int, planes: Sequence[dict[int, float]], windows: np.ndarray, taps: Taps
    ):
        self._size, self._planes = size, []  # selections (12, c) of each plane
        for plane in planes:
            selection = np.zeros((12, len(plane)))
            for column, (channel, sign) in enumerate(plane.items()):
                selection[channel, column] = sign
            self._planes.append(selection)
        self._forces = forces = sum(channel < 6 for channel in planes[0])
        moved = np.concatenate([windows @ selection for selection in self._planes])
        n, now = len(moved), taps.delay - 1
        past, later = (taps.features(moved[:, start : start + now + 1]) for start in (0, 1))
        drive, future = moved[:, now:-1, forces:], moved[:, now + 1 :, :forces]
        E = foreseeing(past, drive.reshape(n, -1), future.reshape(n, -1), size)
        rows = np.hstack([past @ E.T, drive[:, 0]]), np.hstack([later @ E.T, future[:, 0]])
        X, after = (torch.from_numpy(array) for array in rows)
        law = global_fit(X, after[:, :size])
        A, B = stable(law[:size]).T, law[size:].T
        C = global_fit(X[:, :size] @ A.T + X[:, size:] @ B.T, after[:, size:]).T
        self.parameters = [torch.from_numpy(E), A, B, C]

    def encoder(self) -> torch.Tensor:
        """Return E on the features of all channels, (planes * size, taps * 12)."""
        E = self.parameters[0].reshape(self._size, -1, self._planes[0].shape[1])
        rows = [(E @ torch.from_numpy(s.T)).reshape(self._size, -1) for s in self._planes]
        return torch.cat(rows)

    def system(self) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
        """Return A (K, K), B (K, 6) and C (6, K) of all planes, K = planes * size."""
        _, A, B, C = self.parameters
        chi = [torch.from_numpy(s[:6, : self._forces]) for s in self._planes]
        zeta = [torch.from_numpy(s[6:, self._forces :]) for s in self._planes]
        blocks = [stable(A)] * len(self._planes)
        return (
            torch.block_diag(*blocks),
            torch.cat([B @ s.T for s in zeta]),
            torch.cat([s @ C for s in chi], dim=1),
        )


class NeuralWindow:
    """Encoder and lifted linear system, all with gradients, in scaled coordinates.

    Args:
        windows: (n, delay + horizon, 12) of [chi, zeta], scaled, to begin from.
    """

    def __init__(self, config: NeuralWindowConfig, windows: np.ndarray):
        groups = ((config.sway, (X, Y)), (config.heave, (Z,)))
        self._motions = [Motion(size, planes, windows, config.taps) for size, planes in groups]
        self.images = torch.from_numpy(_images(config))
        K, generator = self.images.shape[1], torch.Generator().manual_seed(config.seed)
        sizes = ((config.width, K), (config.width, config.width))
        self._hidden = [
            torch.randn(*size, generator=generator, dtype=torch.float64) for size in sizes
        ]
        self._last = torch.zeros(K, config.width, dtype=torch.float64)
        self.parameters = [*self._hidden, self._last]
        self.parameters += [value for motion in self._motions for value in motion.parameters]
        for value in self.parameters:
            value.requires_grad_()

    def weights(self) -> list[torch.Tensor]:
        """Return the layers, the hidden ones of largest singular value 1."""
        return [*(normalised(W, 1.0) for W in self._hidden), self._last]

    def encoder(self) -> torch.Tensor:
        """Return E (K, taps * 12)."""
        return torch.cat([motion.encoder() for motion in self._motions])

    def lift(self, features: torch.Tensor) -> torch.Tensor:
        """Return z (n, K) of features (n, taps * 12)."""
        eta = features @ self.encoder().T
        turned = perceptron(torch.einsum("nk,gkl->ngl", eta, self.images), self.weights())
        return eta + torch.einsum("ngl,gkl->nk", turned, self.images) / len(self.images)

    def system(self) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
        """Return A (K, K), B (K, 6) and C (6, K)."""
        A, B, C = zip(*(motion.system() for motion in self._motions), strict=True)
        return torch.block_diag(*A), torch.cat(B), torch.cat(C, dim=1)

    def forecast(self, features: torch.Tensor, zeta: torch.Tensor) -> torch.Tensor:
        """Return chi_hat (n, H, 6), 1 … H steps ahead, along zeta (n, H, 6) from now on."""
        A, B, C = self.system()
        z, drive, course = self.lift(features), zeta @ B.T, []
        for i in range(zeta.shape[1]):
            z = z @ A.T + drive[:, i]
            course.append(z)
        return torch.stack(course, dim=1) @ C.T


def _images(config: NeuralWindowConfig) -> np.ndarray:
    """Return what the eight turns and mirrors do to rows z, (8, K, K): a state turns into the same
    one of another plane as the force of its plane does.
    """
    sizes = (config.sway, config.sway, config.heave)
    channel = np.repeat([0, 1, 2], sizes)
    place = np.concatenate([np.arange(size) for size in sizes])
    turned = np.array(turns(np.eye(6)))[:, channel][:, :, channel]
    return turned * (place[:, None] == place)


def train_neural_window(
    segments: list[Segment], config: NeuralWindowConfig, on_epoch: OnEpoch
) -> tuple[LiftedModel, list[float]]:
    """Return (model, loss now and then): the mean square of forecasts over that of the linear
    start, one step ahead.
    """
    length = config.delay + config.horizon
    segments = check_segments(segments, length)
    columns = [s.chi for s in segments], [s.zeta for s in segments]
    scale = np.concatenate([group_scale(values, centred=False) for values in columns])
    pieces = [np.hstack([s.chi, s.zeta]) / scale for s in segments]
    windows = [sliding_window_view(piece, length, axis=0) for piece in pieces]
    places = np.array([(i, k) for i, views in enumerate(windows) for k in range(len(views))])

    def at(chosen: np.ndarray) -> np.ndarray:
        return np.stack([windows[i][k].T for i, k in chosen])

    generator = np.random.default_rng(config.seed)
    model = NeuralWindow(config, at(generator.permutation(places)[:FITTED]))
    optimiser = torch.optim.Adam(model.parameters, lr=config.learning_rate)
    steps = max(config.epochs, 1)
    rate = torch.optim.lr_scheduler.CosineAnnealingLR(optimiser, steps, config.learning_rate / 10)
    taps, now = config.taps, config.delay - 1
    weight: torch.Tensor | None = None
    losses, history = list[float](), list[float]()
    for step in range(1, config.epochs + 1):
        batch = at(places[generator.integers(len(places), size=config.batch)])
        features = torch.from_numpy(taps.features(batch[:, : config.delay]))
        course = torch.from_numpy(batch)
        error = model.forecast(features, course[:, now:-1, 6:]) - course[:, now + 1 :, :6]
        if weight is None:
            weight = _weight(error.detach(), model.system()[2].detach())
        loss = (error**2 * weight).mean()
        descend_once(optimiser, loss)
        rate.step()
        losses.append(loss.item())
        if step % max(1, config.epochs // REPORTS) == 0:
            history.append(float(np.mean(losses)))
            losses = []
            on_epoch(step, config.epochs, history[-1])
    return _exported(model, config, segments, scale, history), history


def _weight(error: torch.Tensor, C: torch.Tensor) -> torch.Tensor:
    """Return one over the mean square of errors (n, H, 6) one step ahead, of channels that C reads:
    of all that turn into one another together.
    """
    square = (error[:, 0] ** 2).mean(dim=0)
    lateral = [square[:2].mean(), square[3:5].mean()]
    shared = torch.stack([lateral[0], lateral[0], square[2], lateral[1], lateral[1], square[5]])
    return torch.where(C.any(dim=1), 1.0 / shared.clamp_min(1e-12), 0.0)


def _exported(
    model: NeuralWindow,
    config: NeuralWindowConfig,
    segments: list[Segment],
    scale: np.ndarray,
    history: list[float],
) -> LiftedModel:
    """Return the model in physical units."""
    with torch.no_grad():
        A, B, C = (matrix.numpy() for matrix in model.system())
        weights = tuple(W.numpy() for W in model.weights())
        E = model.encoder().numpy() / np.tile(scale, len(config.taps.matrix))
    step = float(np.median([segment.step for segment in segments]))
    system = LiftedLinearSystem(A, B / scale[6:], C * scale[:6, None], step)
    encoder = Encoder(config.taps.expand(E, 12), weights, images=model.images.numpy())
    summary = {
        "samples": sum(map(len, segments)),
        "loss": history[-1] if history else None,
        "excitation": excitation(segments),
    }
    return LiftedModel(
        NEURAL_WINDOW, system, encoder, scale[6:], summary, refit=config.refit, ridge=config.ridge
    )
