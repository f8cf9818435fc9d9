"""Decimation of a log from its own rate to a predictor's step."""

import numpy as np

from np_drake.flight_log import FlightLog
from np_drake.labels import LabelConfig, labels, smooth_labels
from np_drake.training_data.wrench_sequence import WrenchSequence
from np_drake.vehicle import Vehicle


def rows_at(log: FlightLog, step: float) -> np.ndarray:
    """Return the indices of the rows nearest to t_0, t_0 + step, …, (m,).

    Rows are picked, not averaged; quantities with content above the new rate must be filtered before (`labels` are).
    Args: step: [s].
    Raises: ValueError: if the step is shorter than the log's, or leaves fewer than two rows.
    """
    if not step > 0.999 * log.step:
        raise ValueError(
            f"decimate: step must be at least that of {log.name}, {log.step:.4g} s; got {step:.4g} s."
        )
    wanted = np.arange(log.t[0], log.t[-1] + 0.5 * log.step, step)
    if len(wanted) < 2:
        raise ValueError(f"decimate: {log.name} lasts {log.t[-1] - log.t[0]:.3g} s, less than {step:.3g} s.")
    after = np.clip(np.searchsorted(log.t, wanted), 1, len(log) - 1)
    return np.where(wanted - log.t[after - 1] < log.t[after] - wanted, after - 1, after)


def wrench_sequence(
    log: FlightLog,
    vehicle: Vehicle,
    config: LabelConfig | None = None,
    *,
    step: float = 0.02,
    zero_phase: bool = False,
) -> WrenchSequence:
    """Return labels made at the log's own rate, then one row every `step` [s]; zeta in W.

    Args:
        zero_phase: `smooth_labels` instead of the causal ones (targets for training only).
    Raises: ValueError: if the log has no accelerations, or the step does not fit.
    """
    chi = (smooth_labels if zero_phase else labels)(log, vehicle, config)
    rows = rows_at(log, step)
    zeta = np.concatenate([log.v, log.w], axis=1)
    return WrenchSequence(step, chi[rows], zeta[rows], "world", log.name, notes=list(log.notes)).check()
