"""Training of the `default` configuration: delay encoder and stable A, B, C on a multi-step loss."""

import dataclasses as dc
from collections.abc import Callable

import numpy as np
import scipy.linalg

from np_drake.lifting.channel_views import Block, free_blocks, symmetric_blocks
from np_drake.lifting.delay_regression import Regularisation, compress
from np_drake.lifting.encoders import DelayEncoder
from np_drake.lifting.excitation import Excitation, measure_excitation
from np_drake.lifting.lifted_linear_system import LiftedLinearSystem
from np_drake.lifting.lifted_model import DEFAULT, LiftedModel
from np_drake.lifting.modal_fit import BlockMatrices, ModalBlock, descend
from np_drake.lifting.segments import Segment, check_segments, group_scale


@dc.dataclass(frozen=True)
class DefaultConfig:
    """`default`: what flew best. Scaled units: chi and zeta over one scale each for force, torque, v and omega."""

    delay: int = 25  # samples the encoder sees [1]
    horizon: int = 40  # longest prediction in the loss [steps]
    horizons: int = 41  # how many horizons of it are in the loss, closer together near 0 [1]
    size: int = 4  # lifted states of a block [1]
    symmetric: bool = True  # tie x and y (force in W, yaw near zero); False for wrenches in other frames
    torque: bool = False  # predict the torque too; else the predictor holds it
    iterations: int = 150  # L-BFGS iterations at most, a block and a start [1]
    starts: int = 3  # starts from different modes; the best is kept [1]
    max_origins: int = 6000  # origins are thinned beyond [1]
    zeta_noise: tuple[float, ...] | None = None  # (6,) noise of zeta [m/s, rad/s]; None: estimated
    regularisation: Regularisation = Regularisation()
    seed: int = 0

    def blocks(self) -> list[Block]:
        """The blocks that are fitted, in the order of their states in z."""
        make = symmetric_blocks if self.symmetric else free_blocks
        return make(self.size, torque=self.torque)


def train_default(
    segments: list[Segment],
    config: DefaultConfig,
    *,
    start: list[np.ndarray] | None = None,
    on_epoch: Callable[[int, int, float], None] = lambda *_: None,
) -> tuple[LiftedModel, list[float], list[np.ndarray]]:
    """(model, loss history, parameters to resume from).

    `start`: parameters of an earlier run, one vector a block; the descent goes on from there (the curvature memory
    of L-BFGS starts afresh).
    """
    segments = check_segments(segments, config.delay + config.horizon + 1)
    step = float(np.median([segment.step for segment in segments]))
    excitation = _excitation(segments, config, step)
    chi_scale = group_scale([segment.goal for segment in segments], centred=True)
    zeta_scale = group_scale([segment.zeta for segment in segments], centred=True)
    scaled = [
        (s.chi / chi_scale, s.zeta @ excitation.shrink.T / zeta_scale, s.goal / chi_scale) for s in segments
    ]
    blocks = config.blocks()
    progress = _Progress(len(blocks) * config.starts * config.iterations, on_epoch)
    fitted, thetas, losses = [], [], {}
    for number, block in enumerate(blocks):
        modal = _modal_block(block, scaled, config, step)
        first = None if start is None else start[number]
        theta = _best_descent(modal, config, number, first, progress)
        thetas.append(theta)
        fitted.append(modal.matrices(theta))
        losses[block.name] = modal.loss_and_gradient(theta)[0]
    system, encoder = _assemble(blocks, fitted, config.delay, step, chi_scale, zeta_scale, excitation)
    summary = {"samples": sum(map(len, segments)), "loss": losses, "excitation": excitation.text}
    model = LiftedModel(DEFAULT, system, encoder, config.delay, chi_scale, zeta_scale, config.torque, summary)
    return model, progress.history, thetas


def _excitation(segments: list[Segment], config: DefaultConfig, step: float) -> Excitation:
    """Of the segments; where x and y are tied, of the segments turned by 90 degrees too."""
    zeta = [segment.zeta for segment in segments]
    if config.symmetric:
        zeta += [piece[:, [1, 0, 2, 4, 3, 5]] * [1, -1, 1, 1, -1, 1] for piece in zeta]
    return measure_excitation(zeta, config.zeta_noise, step=step)


class _Progress:
    """Counts descent iterations over all blocks and starts."""

    def __init__(self, total: int, on_epoch: Callable[[int, int, float], None]):
        self.total, self.on_epoch = total, on_epoch
        self.epoch, self.history = 0, list[float]()

    def __call__(self, loss: float) -> None:
        self.epoch += 1
        self.history.append(loss)
        self.on_epoch(self.epoch, self.total, loss)

    def skip_to(self, epoch: int) -> None:
        """A descent that ended early has used up its share."""
        self.epoch = epoch


def _modal_block(block: Block, scaled: list, config: DefaultConfig, step: float) -> ModalBlock:
    pieces = [
        (chi @ view.labels.T, zeta @ view.inputs.T, goal @ view.selected.T)
        for chi, zeta, goal in scaled
        for view in block.views
    ]
    spread = np.geomspace(1, config.horizon, config.horizons - 1)
    regression = compress(
        pieces, delay=config.delay, horizons=np.unique(np.concatenate([[0], np.round(spread)])).astype(int),
        regularisation=config.regularisation, max_origins=config.max_origins,
    )  # fmt: skip
    return ModalBlock(regression, size=block.size, pairs=block.pairs, step=step)


def _best_descent(modal: ModalBlock, config: DefaultConfig, number: int, first, progress: _Progress) -> np.ndarray:
    """Parameters of the least loss over the starts (`first` alone where given)."""
    generator = np.random.default_rng([config.seed, number])
    starts = [modal.initial_theta(generator) for _ in range(config.starts)] if first is None else [first]
    best, least = starts[0], np.inf
    for run, theta in enumerate(starts):
        theta, _ = descend(modal, theta, iterations=config.iterations, on_iteration=progress)
        progress.skip_to((number * config.starts + run + 1) * config.iterations)
        loss = modal.loss_and_gradient(theta)[0]
        if loss < least:
            best, least = theta, loss
    return best


def _assemble(
    blocks: list[Block], fitted: list[BlockMatrices], delay: int, step: float,
    chi_scale: np.ndarray, zeta_scale: np.ndarray, excitation: Excitation,
) -> tuple[LiftedLinearSystem, DelayEncoder]:  # fmt: skip
    """All views' matrices in one system, in physical units."""
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
