"""The moving-horizon estimator over a whole flight."""

import dataclasses as dc
import time

import numpy as np

from np_drake.estimation.mhe_config import MheConfig
from np_drake.estimation.motion import Motion
from np_drake.estimation.moving_horizon import MheStatus, MovingHorizonEstimator, WindowSolver


@dc.dataclass(frozen=True)
class MheRun:
    """Estimates of one flight.

    wrench: (n, 6) estimate at each row from the rows up to it [N, N·m].   held: rows without an answer of the solver.
    step_time: median of a step [s].
    """

    wrench: np.ndarray
    held: int
    step_time: float


def run_mhe(motion: Motion, config: MheConfig, solver: WindowSolver | None = None) -> MheRun:
    """Run the estimator over a flight, from the first sample of each channel in a hover.

    Source of the start: the published evaluation of Wang et al. 2024.
    Raises: ValueError: if a channel has no sample at all.
    """
    dut = MovingHorizonEstimator(config, motion.step, solver)
    first = np.argmax(np.isfinite(motion.y), axis=0)
    memory = dut.initial_memory(motion.y[first, np.arange(6)], motion.hover)
    d, seconds, held = np.empty_like(motion.y), np.empty(len(motion.y)), 0
    for k, (y, u) in enumerate(zip(motion.y, motion.u, strict=True)):
        start = time.perf_counter()
        memory, estimate = dut.update(memory, y, u)
        seconds[k] = time.perf_counter() - start
        d[k] = estimate.acceleration
        held += estimate.status is MheStatus.HELD
    return MheRun(motion.wrench(d), held, float(np.median(seconds)))
