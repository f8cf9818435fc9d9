"""Training of the `delay-modal` configuration: delay encoder and stable A, B, C on a multi-step loss."""

import dataclasses as dc

import numpy as np
import scipy.linalg

from np_drake.lifting.model.channel_views import Block, free_blocks, symmetric_blocks, turns
from np_drake.lifting.model.encoders import DelayEncoder
from np_drake.lifting.model.lifted_linear_system import LiftedLinearSystem
from np_drake.lifting.model.lifted_model import DELAY_MODAL, LiftedModel
from np_drake.lifting.model.onsets import Onsets
from np_drake.lifting.training.checkpoint import Checkpoint, OnEpoch
from np_drake.lifting.training.delay_regression import Regularisation, compress
from np_drake.lifting.training.excitation import Excitation, measure_excitation
from np_drake.lifting.training.horizon_ridge import horizon_grid
from np_drake.lifting.training.modal_fit import BlockMatrices, ModalBlock, descend
from np_drake.lifting.training.onset_fit import BlockOnsets, fit_onsets, label_lag, stack_onsets
from np_drake.training_data.segments import Segment, check_segments, group_scale

SETTLED = 10  # steps after which a label no longer shows how it began [1]


@dc.dataclass(frozen=True)
class DelayModalConfig:
    """Parameters of the `delay-modal` configuration.

    Force, torque, v and omega are each divided by one scale.
    """

    delay: int = 50  # samples the encoder sees [1]
    horizon: int = 40  # longest prediction in the loss [steps]
    horizons: int = 25  # how many horizons of it are in the loss, closer together near 0 [1]
    size: int | None = None  # lifted states of a block; None: 4 tied (12 in all), 24 untied [1]
    symmetric: bool = True  # tie x and y (force in W, yaw near zero); False for wrenches in other frames
    torque: bool = False  # predict the torque too; else the predictor holds it
    onset_odds: float = 0.05  # that a swing or a new level began at one age in the window; 0: never [1]
    onset_size: float = 1.0  # its standard deviation, in scales of the force or torque [1]
    onset_spacing: int = 4  # between the ages that are considered [1]
    other_odds: float = 1.0  # that the whole window shows another swing and level than the training [1]
    iterations: int = 150  # L-BFGS iterations at most, a block and a start [1]
    starts: int = 3  # starts from different modes; the best is kept [1]
    max_origins: int = 6000  # origins are thinned beyond [1]
    zeta_noise: tuple[float, ...] | None = None  # (6,) noise of zeta [m/s, rad/s]; None: estimated
    regularisation: Regularisation = dc.field(default_factory=lambda: Regularisation(zeta_noise=0.02))
    seed: int = 0  # of the starts

    @property
    def onsets(self) -> dict[int, float]:
        """Ages at which a motion may have begun [steps], with their odds [1]; empty where `onset_odds` is 0.

        The last age lies before the window, by so much that the label has settled.
        """
        if self.onset_odds == 0:
            return {}
        within = range(max(1, self.onset_spacing - 1), self.delay - self.onset_spacing, self.onset_spacing)
        before = {self.delay + SETTLED: self.other_odds} if self.other_odds > 0 else {}
        return dict.fromkeys(within, self.onset_odds) | before

    def blocks(self) -> list[Block]:
        """Return the blocks that are fitted, in the order of their states in z."""
        if self.symmetric:
            return symmetric_blocks(self.size or 4, torque=self.torque)
        return free_blocks(self.size or 24, torque=self.torque)


def train_delay_modal(
    segments: list[Segment], config: DelayModalConfig, checkpoint: Checkpoint, on_epoch: OnEpoch
) -> tuple[LiftedModel, list[float]]:
    """Return (model, loss after each iteration) of the `delay-modal` configuration.

    Finished descents are in the checkpoint; a resumed run repeats the others, which draw from seeds of their
    own, and so ends where an uninterrupted one does.

    Args:
        segments: uninterrupted flights at one step.
        config: of the training.
        checkpoint: of finished descents.
        on_epoch: called after each iteration.
    """
    segments = check_segments(segments, config.delay + config.horizon + 1)
    step = float(np.median([segment.step for segment in segments]))
    excitation = _excitation(segments, config, step)
    chi_scale = group_scale([segment.goal for segment in segments], centred=True)
    zeta_scale = group_scale([segment.zeta for segment in segments], centred=True)
    scaled = [(s.chi / chi_scale, s.zeta @ excitation.shrink.T / zeta_scale, s.goal / chi_scale) for s in segments]
    blocks = config.blocks()
    runs = _Runs(checkpoint, len(blocks) * config.starts * config.iterations, on_epoch)
    fitted, begun, losses = [], [], {}
    for number, block in enumerate(blocks):
        modal = _modal_block(block, scaled, config, step)
        theta, losses[block.name] = _best_descent(modal, config, number, runs)
        fitted.append(modal.matrices(theta))
        begun.append(_block_onsets(block, modal, fitted[-1], scaled, config))
    system, encoder = _assemble(blocks, fitted, config.delay, step, chi_scale, zeta_scale, excitation)
    onsets = _onsets(blocks, begun, config, chi_scale, zeta_scale, excitation)
    summary = {"samples": sum(map(len, segments)), "loss": losses, "excitation": excitation.text}
    model = LiftedModel(DELAY_MODAL, system, encoder, config.delay, chi_scale, zeta_scale, config.torque, summary)
    return dc.replace(model, onsets=onsets), runs.history


class _Runs:
    """Finished descents, by block and start, and the progress over all of them."""

    def __init__(self, checkpoint: Checkpoint, total: int, on_epoch: OnEpoch):
        self._checkpoint, self._total, self._on_epoch = checkpoint, total, on_epoch
        self._finished = checkpoint.load()
        self._epoch, self.history = 0, list[float]()

    def descend(self, name: str, modal: ModalBlock, theta: np.ndarray, iterations: int) -> np.ndarray:
        """Return the end of the descent called `name`, computed or taken from the checkpoint."""
        end = self._epoch + iterations
        if name not in self._finished:
            found, losses = descend(modal, theta, iterations=iterations, on_iteration=self._report)
            self._finished |= {name: found, f"{name}/loss": np.array(losses)}
            self._checkpoint.save(self._finished)
        self.history += self._finished[f"{name}/loss"].tolist()
        if self._epoch < end:
            self._epoch = end - 1
            self._report(self.history[-1] if self.history else np.inf)
        return self._finished[name]

    def _report(self, loss: float) -> None:
        self._epoch += 1
        self._on_epoch(self._epoch, self._total, loss)


def _best_descent(modal: ModalBlock, config: DelayModalConfig, number: int, runs: _Runs) -> tuple[np.ndarray, float]:
    """Return the parameters of the least loss over the starts, and that loss."""
    found = []
    for run in range(config.starts):
        theta = modal.initial_theta(np.random.default_rng([config.seed, number, run]))
        theta = runs.descend(f"{number}/{run}", modal, theta, config.iterations)
        found.append((modal.loss_and_gradient(theta)[0], run, theta))
    loss, _, theta = min(found, key=lambda entry: entry[:2])
    return theta, loss


def _excitation(segments: list[Segment], config: DelayModalConfig, step: float) -> Excitation:
    """Return the excitation of the segments and, where x and y are tied, of their rotations and mirror images."""
    zeta = [segment.zeta for segment in segments]
    if config.symmetric:
        zeta = [turned for piece in zeta for turned in turns(piece)]
    return measure_excitation(zeta, config.zeta_noise, step=step)


def _modal_block(block: Block, scaled: list, config: DelayModalConfig, step: float) -> ModalBlock:
    pieces = [
        (chi @ view.labels.T, zeta @ view.inputs.T, goal @ view.selected.T)
        for chi, zeta, goal in scaled
        for view in block.views
    ]
    regression = compress(
        pieces, delay=config.delay, horizons=horizon_grid(config.horizon, config.horizons),
        regularisation=config.regularisation, max_origins=config.max_origins,
    )  # fmt: skip
    return ModalBlock(regression, size=block.size, pairs=block.pairs, step=step)


def _assemble(
    blocks: list[Block], fitted: list[BlockMatrices], delay: int, step: float,
    chi_scale: np.ndarray, zeta_scale: np.ndarray, excitation: Excitation,
) -> tuple[LiftedLinearSystem, DelayEncoder]:  # fmt: skip
    """Return all views' matrices in one system, in physical units."""
    seen = excitation.shrink / zeta_scale[:, None]  # zeta -> scaled zeta as trained
    As, Bs, Cs, Es = [], [], [], []
    for block, m in zip(blocks, fitted, strict=True):
        for view in block.views:
            channels = len(view.labels) + len(view.inputs)
            E = m.E.reshape(len(m.A), delay, channels)
            E_chi = E[..., : len(view.labels)] @ (view.labels / chi_scale)
            E_zeta = E[..., len(view.labels) :] @ view.inputs @ seen
            Es.append(np.concatenate([E_chi, E_zeta], axis=-1).reshape(len(m.A), -1))
            As.append(m.A)
            Bs.append(m.B @ view.inputs @ seen)
            Cs.append(chi_scale[:, None] * (view.selected.T @ m.C))
    A = scipy.linalg.block_diag(*As)
    system = LiftedLinearSystem(A, np.vstack(Bs), np.hstack(Cs), step)
    return system, DelayEncoder(np.vstack(Es), delay)


def _block_onsets(
    block: Block, modal: ModalBlock, m: BlockMatrices, scaled: list, config: DelayModalConfig
) -> BlockOnsets | None:
    """Return the onsets of a block: levels in every block, and oscillation where something swings."""
    if not config.onsets:
        return None
    levels = np.arange(block.size - len(m.C), block.size)
    modes = np.concatenate([np.arange(2 * block.pairs if block.swings else 0), levels])
    views = [(chi @ view.selected.T, goal @ view.selected.T) for chi, _, goal in scaled for view in block.views]
    return fit_onsets(
        m, modal.whitener, modes=modes, ages=list(config.onsets), delay=config.delay, size=config.onset_size,
        lag=label_lag(views),
    )  # fmt: skip


def _onsets(
    blocks: list[Block], begun: list[BlockOnsets | None], config: DelayModalConfig,
    chi_scale: np.ndarray, zeta_scale: np.ndarray, excitation: Excitation,
) -> Onsets | None:  # fmt: skip
    """Return all views' onsets, in physical units."""
    seen, parts = excitation.shrink / zeta_scale[:, None], []
    for block, found in zip(blocks, begun, strict=True):
        if found is None:
            return None
        for view in block.views:
            parts.append((scipy.linalg.block_diag(view.labels / chi_scale, view.inputs @ seen), found))
    return stack_onsets(parts, np.array(list(config.onsets.values())))
