"""Fixed dictionary of decaying modes, for which the best lifted linear system is a linear
least-squares problem.

Every channel of chi has modes lambda^h of its own; chi_hat_h = sum over modes of lambda^h times an
amplitude, and z holds the amplitudes. So A = diag(lambda) is stable whatever the data say, C = 1,
B = 0, and only E is learned. A B that acts on what zeta adds to its last value foresees no more of
the force of real flights (own measurement).
Geometrically spaced time constants represent any course that is smooth in log h.
Source: own choice, after the basis functions of Wahlberg & Mäkilä 1996.

The encoder is found horizon by horizon first. For zeta held at its last value a lifted linear
system answers chi_hat_h = C A^h E w (+ constant): one linear map W_h of the window a horizon.
Fitted freely, by ridge on delayed samples with flights weighted alike, W_h bounds what any of them
can do; E is the closest to it.       Source: own choice; the two steps of subspace identification.
"""

import dataclasses as dc
from collections.abc import Sequence

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from np_drake.lifting.model.lifted_linear_system import Encoder, LiftedLinearSystem, Taps, Trust
from np_drake.lifting.model.lifted_model import MODE_DICTIONARY, LiftedModel
from np_drake.lifting.training import OnEpoch
from np_drake.lifting.training.excitation import TURNS, excitation
from np_drake.training_data.segments import Segment, check_segments, group_scale

GROUPS = (slice(0, 3), slice(3, 6))  # force, torque
NOW = 100.0  # power at horizon 0, where nothing is to be forecast, in units of that one step ahead
CONSTANT = 1e-9  # ridge of the constant feature, whose own power is 1


@dc.dataclass(frozen=True)
class Moments:
    """Second moments of one flight, scaled.

    The last of the p features is the constant 1.
    power: (H, 2) squared error of the better naive row: mean squared change of force and of torque
        over the horizon, or their variance where that is less.
    """

    gram: np.ndarray  # (p, p) of the features
    cross: np.ndarray  # (p, H, 6) of features and goals
    square: np.ndarray  # (H, 6) of the goals
    power: np.ndarray


def flight_moments(
    samples: np.ndarray,
    goal: np.ndarray,
    *,
    taps: Taps,
    horizons: np.ndarray,
    max_origins: int,
    symmetry: float,
) -> Moments:
    """Return the moments of a flight over evenly thinned origins.

    Args:
        samples: (n, 12) [chi, zeta], scaled.
        goal: (n, 6), scaled.
        horizons: ascending [steps].
        symmetry: share of the moments that is averaged over quarter turns about body z and the
            mirror y -> -y, 0 … 1. The mean of the images is that of a perfectly symmetric airframe.
    """
    first = taps.delay - 1
    last = len(samples) - int(horizons[-1])
    origins = np.arange(first, last, max(1, -(-(last - first) // max_origins)))
    windows = sliding_window_view(samples, taps.delay, axis=0)[origins - taps.delay + 1]
    F = np.hstack([taps.features(windows.transpose(0, 2, 1)), np.ones((len(origins), 1))])
    Y = goal[origins[:, None] + horizons]
    gram = F.T @ F / len(F)
    cross = (F.T @ Y.reshape(len(F), -1) / len(F)).reshape(-1, len(horizons), 6)
    change = np.mean((Y - samples[origins, None, :6]) ** 2, axis=0)
    power = np.minimum(_grouped(change), _grouped(np.var(Y, axis=0)))
    power[horizons == 0] = NOW * power[horizons > 0].min(axis=0)
    gram, cross = symmetrised(gram, cross, symmetry)
    return Moments(gram, cross, np.mean(Y**2, axis=0), np.maximum(power, 1e-12))


def relative_error(flight: Moments, W: np.ndarray) -> np.ndarray:
    """Return the mean squared error of a forecast over `power`, (H, 2), force and torque [1].

    Args:
        W: (p, H, 6) weights of the features.
    """
    explained = np.einsum("phc,phc->hc", W, 2 * flight.cross)
    explained -= np.einsum("phc,phc->hc", W, np.tensordot(flight.gram, W, axes=1))
    return _grouped(flight.square - explained) / flight.power


def horizon_ridge(flights: Sequence[Moments], *, noise: float) -> np.ndarray:
    """Return the weights W_h of the features, (p, H, 6); the error of each flight counts relative
    to its `power`.

    Args:
        noise: deviation of white noise that the features are taken to have [scaled]. It keeps W_h
            from differencing what another flight's filter or sensor makes differently.
    """
    p, H, _ = flights[0].cross.shape
    W = np.empty((p, H, 6))
    ridge = np.diag(np.append(np.full(p - 1, noise**2), CONSTANT))
    for h in range(H):
        for k, group in enumerate(GROUPS):
            weight = np.array([1.0 / flight.power[h, k] for flight in flights])
            weight /= weight.sum()
            gram = sum(w * flight.gram for w, flight in zip(weight, flights, strict=True))
            cross = sum(
                w * flight.cross[:, h, group] for w, flight in zip(weight, flights, strict=True)
            )
            # Ridge: (sum_f w_f G_f + diag(noise²)) W_h = sum_f w_f X_f'Y_f
            W[:, h, group] = np.linalg.solve(gram + ridge, cross)
    return W


def symmetrised(gram: np.ndarray, cross: np.ndarray, share: float) -> tuple[np.ndarray, np.ndarray]:
    """Return moments of which a share is averaged over those of the turned flights.

    Args:
        gram: (p, p) of features, groups of six that turn and at most one constant.
        cross: (p, ..., 6) of features and goals.
        share: of the average [1].
    """
    grams = []
    crosses = []
    turning = len(gram) // 6 * 6
    T = np.eye(len(gram))
    for turn in TURNS:
        T[:turning, :turning] = np.kron(np.eye(turning // 6), turn)
        grams.append(T.T @ gram @ T)
        crosses.append(np.tensordot(T.T, cross, axes=1) @ turn)
    mean_gram = np.mean(grams, axis=0)
    mean_cross = np.mean(crosses, axis=0)
    return (1 - share) * gram + share * mean_gram, (1 - share) * cross + share * mean_cross


def _grouped(square: np.ndarray) -> np.ndarray:
    """Sum (H, 6) over force and torque to (H, 2)."""
    return np.stack([square[:, group].sum(axis=1) for group in GROUPS], axis=1)


@dc.dataclass(frozen=True)
class ModeDictionary:
    """Decaying modes of each channel of chi."""

    poles: np.ndarray  # (K,) lambda of each, in (0, 1) [1]
    channel: np.ndarray  # (K,) that each belongs to

    @property
    def C(self) -> np.ndarray:
        """Output matrix that sums each channel's modes, (6, K)."""
        return (self.channel == np.arange(6)[:, None]).astype(float)

    def readout(self, horizons: np.ndarray) -> np.ndarray:
        """Return C A^h for every horizon, (H, 6, K)."""
        return self.C * (self.poles ** horizons[:, None])[:, None]

    def projector(
        self, horizons: np.ndarray, weights: np.ndarray, *, ridge: float = 1e-8
    ) -> np.ndarray:
        """Return the map from a trajectory chi (H, 6) to its amplitudes z, (K, H, 6), by least
        squares.

        It is applied as z = einsum("khc,hc", projector, chi).

        Args:
            horizons: (H,) of the trajectory [steps].
            weights: (H, 2) of the errors of force and torque at each.
            ridge: relative to the mean power [1].
        """
        out = np.zeros((len(self.poles), len(horizons), 6))
        for channel in range(6):
            modes = self.channel == channel
            weight = weights[:, channel // 3]
            basis = self.poles[modes] ** horizons[:, None] * weight[:, None]
            # Least squares of a trajectory on lambda^h, weighted: (V'V + ridge) z = V' w chi
            normal = basis.T @ basis
            normal[np.diag_indices(len(normal))] += ridge * np.trace(normal) / len(normal)
            out[modes, :, channel] = np.linalg.solve(normal, basis.T * weight)
        return out


def time_constants(
    force: tuple[float, ...], torque: tuple[float, ...], level: float
) -> ModeDictionary:
    """Return the modes of given time constants [steps].

    The total force of a flight has a level that lasts (thrust in excess of hover); torque has none.
    """
    f = np.exp(-1.0 / np.append(force, level))
    t = np.exp(-1.0 / np.asarray(torque, float))
    poles = [f, f, f, t, t, t]
    return ModeDictionary(np.concatenate(poles), np.repeat(np.arange(6), [len(p) for p in poles]))


LEVEL_MEMORY = 200.0  # time constant of what is held [s]


@dc.dataclass(frozen=True)
class ModeDictionaryConfig:
    """Parameters of the `mode-dictionary` configuration.

    Steps are those of the data (2.5 ms on the paper's arrays).
    """

    delay: int = 87  # samples the encoder sees [1]
    dense: int = 12  # of them one by one, the newest [1]
    averages: int = 11  # the others in so many averages [1]
    horizon: int = 400  # longest forecast that is fitted [steps]
    horizons: int = 18  # how many are, closer together near 0 [1]
    # Time constants, beside a level [steps]
    force_modes: tuple[float, ...] = (1.5, 4.0, 11.0, 32.0, 100.0, 300.0)
    # time constants [steps]
    torque_modes: tuple[float, ...] = 1.5, 4.0, 10.0, 25.0, 60.0, 150.0, 400.0
    noise: float = 3e-4  # of the samples the encoder sees, in units of their scale [1]
    # how symmetric the airframe is taken to be: about body z and left to right [1]
    symmetry: float = 0.8
    # horizon at which half a departure is believed before any evidence [steps]
    trust_half: float = 200.0
    max_origins: int = 4000  # of a segment; thinned beyond [1]
    seed: int = 0  # nothing is drawn; kept for the one interface of all configurations

    @property
    def taps(self) -> Taps:
        """Samples and averages that the encoder sees."""
        return Taps.averaging(self.delay, self.dense, self.averages)

    @property
    def grid(self) -> np.ndarray:
        """Fitted horizons [steps]: 0 and whole numbers evenly spaced on a logarithmic axis."""
        later = np.round(np.geomspace(1, self.horizon, self.horizons - 1))
        return np.unique(np.append(0, later)).astype(int)


def train_mode_dictionary(
    segments: list[Segment], config: ModeDictionaryConfig, on_epoch: OnEpoch
) -> tuple[LiftedModel, list[float]]:
    """Return (model, [loss]) of the `mode-dictionary` configuration.

    The loss is the mean square of the held forecast's error over that of the better naive row [1].
    """
    segments = check_segments(segments, config.delay + config.horizon + 1)
    step = float(np.median([segment.step for segment in segments]))
    columns = [s.goal for s in segments], [s.zeta for s in segments]
    # Of a sample [chi, zeta], one each for force, torque, v and omega [N, N·m, m/s, rad/s]
    scale = np.concatenate([group_scale(values, centred=True) for values in columns])
    flights: list[Moments] = []
    for number, segment in enumerate(segments):
        flights.append(
            flight_moments(
                np.hstack([segment.chi, segment.zeta]) / scale,
                segment.goal / scale[:6],
                taps=config.taps,
                horizons=config.grid,
                max_origins=config.max_origins,
                symmetry=config.symmetry,
            )
        )
        on_epoch(number + 1, len(segments) + 1, np.inf)
    modes = time_constants(config.force_modes, config.torque_modes, LEVEL_MEMORY / step)
    weights = np.sqrt(np.mean([1.0 / flight.power for flight in flights], axis=0))
    projector = modes.projector(config.grid, weights)
    W = horizon_ridge(flights, noise=config.noise)
    encoder = np.einsum("khc,phc->kp", projector, W)
    fitted = np.einsum("hck,kp->phc", modes.readout(config.grid), encoder)
    loss = float(np.mean([relative_error(flight, fitted) for flight in flights]))
    on_epoch(len(segments) + 1, len(segments) + 1, loss)
    model = _assemble(config, modes, encoder, projector, scale, step, segments)
    summary = {
        "samples": sum(map(len, segments)),
        "loss": {"all": loss},
        "excitation": excitation(segments),
    }
    return dc.replace(model, summary=summary), [loss]


def _assemble(config, modes, encoder, projector, scale, step, segments) -> LiftedModel:
    """Return the model in physical units."""
    unit = scale[modes.channel]  # of each amplitude [N, N·m]
    E = config.taps.expand(encoder[:, :-1] * unit[:, None], 12) / np.tile(scale, config.delay)
    system = LiftedLinearSystem(np.diag(modes.poles), np.zeros((len(unit), 6)), modes.C, step)
    ahead = config.grid > 0
    trust = Trust(
        config.grid[ahead],
        modes.readout(config.grid[ahead]),
        projector[:, ahead],
        np.mean([segment.goal.mean(axis=0) for segment in segments], axis=0),
        half=config.trust_half,
    )
    encoder = Encoder(E, offset=encoder[:, -1] * unit)
    return LiftedModel(MODE_DICTIONARY, system, encoder, trust=trust)
