"""Training of the `mode-dictionary` configuration, for wrenches in body axes.

It is in closed form: nothing is drawn at random and nothing is iterated.
"""

import dataclasses as dc

import numpy as np

from np_drake.lifting.model.delay_taps import DelayTaps
from np_drake.lifting.model.encoders import DelayEncoder
from np_drake.lifting.model.lifted_model import MODE_DICTIONARY, LiftedModel
from np_drake.lifting.model.trust import Trust
from np_drake.lifting.training import OnEpoch
from np_drake.lifting.training.dmdc import sample_scale
from np_drake.lifting.training.excitation import training_summary
from np_drake.lifting.training.horizon_ridge import (
    Moments,
    horizon_grid,
    horizon_ridge,
    moments_of,
    relative_error,
)
from np_drake.lifting.training.mode_dictionary import (
    ModeDictionary,
    coupled,
    fit_response,
    time_constants,
)
from np_drake.training_data.segments import Segment, check_segments

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
    torque_modes: tuple[float, ...] = (
        1.5,
        4.0,
        10.0,
        25.0,
        60.0,
        150.0,
        400.0,
    )  # time constants [steps]
    noise: float = 3e-4  # of the samples the encoder sees, in units of their scale [1]
    input_noise: float = 0.01  # of the coming zeta, in units of its scale [1]
    strength: float = (
        0.03  # prior deviation of what a unit of zeta adds to chi in each mode, both scaled [1]
    )
    symmetry: float = (
        0.8  # how symmetric the airframe is taken to be: about body z and left to right [1]
    )
    trust_half: float = (
        200.0  # horizon at which half a departure is believed before any evidence [steps]
    )
    max_origins: int = 4000  # of a segment; thinned beyond [1]
    seed: int = 0  # nothing is drawn; kept for the one interface of all configurations

    @property
    def taps(self) -> DelayTaps:
        """Samples and averages that the encoder sees."""
        return DelayTaps(self.delay, self.dense, self.averages)

    @property
    def grid(self) -> np.ndarray:
        """Fitted horizons [steps]."""
        return horizon_grid(self.horizon, self.horizons)


def train_mode_dictionary(
    segments: list[Segment], config: ModeDictionaryConfig, on_epoch: OnEpoch
) -> tuple[LiftedModel, list[float]]:
    """Return (model, [loss]) of the `mode-dictionary` configuration.

    The loss is the mean square of the held forecast's error over that of the better naive row [1].
    The checkpoint is not used: there is nothing to resume.
    """
    segments = check_segments(segments, config.delay + config.horizon + 1)
    step = float(np.median([segment.step for segment in segments]))
    scale = sample_scale(segments, "goal")
    options = {"taps": config.taps, "horizons": config.grid, "max_origins": config.max_origins}
    flights: list[Moments] = []
    for number, segment in enumerate(segments):
        flights += moments_of([segment], scale, symmetry=config.symmetry, **options)
        on_epoch(number + 1, len(segments) + 2, np.inf)
    modes = time_constants(config.force_modes, config.torque_modes, LEVEL_MEMORY / step)
    weights = np.sqrt(np.mean([1.0 / flight.power for flight in flights], axis=0))
    projector = modes.projector(config.grid, weights)
    W = horizon_ridge(flights, noise=config.noise)
    encoder = np.einsum("khc,phc->kp", projector, W)
    B = _response(segments, flights, encoder, modes, config, scale)
    fitted = np.einsum("hck,kp->phc", modes.readout(config.grid), encoder)
    loss = float(np.mean([relative_error(flight, fitted) for flight in flights]))
    on_epoch(len(segments) + 2, len(segments) + 2, loss)
    model = _assemble(config, modes, encoder, B, projector, scale, step, segments)
    return dc.replace(model, summary=training_summary(segments, loss, step)), [loss]


def _response(
    segments: list[Segment],
    flights: list[Moments],
    encoder: np.ndarray,
    modes: ModeDictionary,
    config: ModeDictionaryConfig,
    scale: np.ndarray,
) -> np.ndarray:
    """Return B (K, 6), scaled, on origins thinned to a quarter of those of the encoder."""
    readout, pieces = modes.readout(config.grid), []
    for segment, flight in zip(segments, flights, strict=True):
        samples = np.hstack([segment.chi, segment.zeta]) / scale
        first, last = config.delay - 1, len(samples) - config.horizon
        origins = np.arange(first, last, max(1, -(-(last - first) * 4 // config.max_origins)))
        F = np.hstack([config.taps.features(samples, origins), np.ones((len(origins), 1))])
        forecast = np.einsum("hck,ok->ohc", readout, F @ encoder.T, optimize=True)
        rest = (segment.goal / scale[:6])[origins[:, None] + config.grid] - forecast
        pieces.append((samples[:, 6:], origins, rest, flight.power))
    return fit_response(
        pieces,
        modes,
        config.grid,
        noise=config.input_noise,
        strength=config.strength,
        symmetry=config.symmetry,
    )


def _assemble(config, modes, encoder, B, projector, scale, step, segments) -> LiftedModel:
    """Return the model in physical units."""
    channel = np.concatenate([[c] * len(p) for c, p in enumerate(modes.poles)])
    unit = scale[channel]  # of each amplitude [N, N·m]
    window = (
        config.taps.expand(encoder[:, :-1] * unit[:, None], 12).reshape(modes.K, config.delay, 12)
        / scale
    )
    last = np.zeros((6, config.delay, 12))
    last[:, -1, 6:] = np.eye(6)  # the last zeta, as it is
    E = np.concatenate([window, last]).reshape(modes.K + 6, -1)
    offset = np.concatenate([encoder[:, -1] * unit, np.zeros(6)])
    system = coupled(
        modes, B * unit[:, None] / scale[6:], float(np.exp(-step / LEVEL_MEMORY)), step
    )
    ahead = config.grid > 0
    readout = modes.readout(config.grid[ahead])
    unread = np.zeros((*readout.shape[:2], 6))  # the last zeta
    trust = Trust(
        config.grid[ahead],
        np.concatenate([readout, unread], axis=2),
        np.concatenate([projector[:, ahead], np.zeros((6, ahead.sum(), 6))]),
        np.mean([segment.goal.mean(axis=0) for segment in segments], axis=0),
        half=config.trust_half,
    )
    return LiftedModel(
        MODE_DICTIONARY,
        system,
        DelayEncoder(E, config.delay, offset),
        config.delay,
        scale[:6],
        scale[6:],
        True,
        trust=trust,
    )
