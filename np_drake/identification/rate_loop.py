"""Rate loop of an autopilot, identified from the rates that it was asked for and those that were
flown.
"""

import dataclasses as dc
from collections.abc import Sequence

import numpy as np
import scipy

from np_drake.flight_log import FlightLog
from np_drake.vehicle.sources import HALF_WIDTH_95
from np_drake.vehicle.vehicle import LOOP_GAINS, SLOWEST

# Frequency [rad/s], damping [1] and delay [s] of a loop: where they are looked for, and from where;
# own choice.
BOUNDS = ((1.0, 300.0), (0.2, 5.0), (1e-4, 0.15))
STARTS = ((8.0, 1.0, 0.02), (20.0, 1.0, 0.02), (50.0, 1.0, 0.02))
TINY = 1e-12
# time after which the start of a block is left out [s]; own choice: several lags of a slow loop
FORGOTTEN = 1.0
# of a flight, of which one is left out at a time [s]; own choice: several turns of a slow loop
LOOP_BLOCK = 5.0
FEWEST = 4  # blocks that give an interval [1]
# correlation of command and rate below which a loop is not shown [1]; source: own choice
LEAST_CORRELATION = 0.3


@dc.dataclass(frozen=True)
class AxisLoop:
    """Loop of one body axis."""

    # time at which the rate has followed 63 % of a step of its command, delays among it [s]
    lag: float
    gain: float  # rate over command, at rest [1]
    lag_interval: tuple[float, float]  # 95 % [s]
    gain_interval: tuple[float, float]  # 95 % [1]
    max_rate: float  # largest that was commanded [rad/s]
    share: float  # of the rate's mean square that it explains [1]


@dc.dataclass(frozen=True)
class _Block:
    """Stretch without gaps: command held from its row, rate, and sampling time."""

    command: np.ndarray  # (n,) [rad/s]
    rate: np.ndarray  # (n,) [rad/s]
    step: float  # [s]


def identify_rate_loop(flights: Sequence[FlightLog]) -> tuple[AxisLoop, AxisLoop, AxisLoop] | None:
    """Return the loops of roll, pitch and yaw; None where a flight has no commanded rates, or shows
    no loop.

    For each axis a second-order loop behind a delay, with an offset for each block of 5 s, is
    fitted to the measured rate by least squares; its lag is read from its step response. Intervals
    are those of the jackknife over blocks.

    Args:
        flights: of one vehicle, whose rows hold the commanded rates.
    """
    if not flights or any(log.commanded_rates is None for log in flights):
        return None
    loops = [_axis([block for log in flights for block in _blocks(log, axis)]) for axis in range(3)]
    return None if any(loop is None for loop in loops) else tuple(loops)  # type: ignore[return-value]


def _blocks(log: FlightLog, axis: int) -> list[_Block]:
    commanded = log.commanded_rates
    if commanded is None or len(log) < 2:
        return []
    step = log.step
    rows = max(int(LOOP_BLOCK / log.step), 10)
    complete = np.isfinite(commanded[:, axis]) & np.isfinite(log.w[:, axis])
    complete[1:] &= np.abs(np.diff(log.t) - step) < 0.5 * step
    parts = (slice(start, start + rows) for start in range(0, len(log) - rows + 1, rows))
    return [
        _Block(commanded[part, axis], log.w[part, axis], step)
        for part in parts
        if complete[part].all()
    ]


def _axis(blocks: Sequence[_Block]) -> AxisLoop | None:
    if len(blocks) < FEWEST:
        return None
    z, gain, share = _fit(blocks, *np.log(STARTS))
    if share < LEAST_CORRELATION**2 or not (
        LOOP_GAINS[0] <= gain <= LOOP_GAINS[1] and _rise(z) <= SLOWEST
    ):
        return None
    refits = [_fit([*blocks[:k], *blocks[k + 1 :]], z)[:2] for k in range(len(blocks))]
    leave_one_out = np.array([(_rise(part), g) for part, g in refits])
    most = max(float(np.abs(block.command).max()) for block in blocks)
    n = len(blocks)
    middle = np.array([_rise(z), gain])
    deviation = np.sqrt(
        (n - 1) / n * np.sum((leave_one_out - leave_one_out.mean(axis=0)) ** 2, axis=0)
    )
    low = np.maximum(middle - HALF_WIDTH_95 * deviation, 0.0)
    high = middle + HALF_WIDTH_95 * deviation
    within = [(float(a), float(b)) for a, b in zip(low, high, strict=True)]
    return AxisLoop(float(middle[0]), gain, within[0], within[1], most, share)


def _fit(blocks: Sequence[_Block], *starts: np.ndarray) -> tuple[np.ndarray, float, float]:
    """Return z = log of [frequency [rad/s], damping, delay [s]], gain, and the share of the mean
    square explained.

    The gain is eliminated: for given z it is a linear least squares.
    """

    def at(z: np.ndarray) -> tuple[np.ndarray, float, float]:
        parts = []
        for block in blocks:
            late = min(int(FORGOTTEN / block.step), len(block.rate) // 2)
            y = _response(block, z)[late:]
            w = block.rate[late:]
            parts.append((y - y.mean(), w - w.mean()))
        y, w = (np.concatenate(values) for values in zip(*parts, strict=True))
        gain = float(y @ w) / max(float(y @ y), TINY)
        square = max(float(w @ w), TINY)
        return (w - gain * y) / np.sqrt(square), gain, gain * float(y @ w) / square

    low, high = np.log(BOUNDS).T
    fits = [
        scipy.optimize.least_squares(
            lambda z: at(z)[0], np.clip(z, low + 1e-6, high - 1e-6), bounds=(low, high)
        )
        for z in starts
    ]
    best = min(fits, key=lambda one: one.cost)
    return best.x, *at(best.x)[1:]


def _response(block: _Block, z: np.ndarray) -> np.ndarray:
    """Return the rate (n,) of a loop of gain 1 that starts settled; the command is held from row to
    row [rad/s].
    """
    frequency, damping, delay = np.exp(z)
    a = np.array([[0.0, 1.0], [-(frequency**2), -2 * damping * frequency]])
    b = np.array([[0.0], [frequency**2]])
    c = np.array([[1.0, 0.0]])
    top, bottom = scipy.signal.ss2tf(
        *scipy.signal.cont2discrete((a, b, c, np.zeros((1, 1))), block.step)[:4]
    )
    whole_steps, part = divmod(delay / block.step, 1.0)
    n = len(block.rate)
    first = block.command[0]
    command = np.concatenate([np.full(int(whole_steps) + 1, first), block.command])[: n + 1]
    acting = part * command[:-1] + (1 - part) * command[1:]
    return first + scipy.signal.lfilter(top[0], bottom, acting - first)


def _rise(z: np.ndarray) -> float:
    """Return the time after a step of the command at which the loop has followed 63 % of it [s]."""
    frequency, damping, delay = np.exp(z)
    t = np.linspace(0.0, 20 * max(1.0, damping) / frequency, 4000)
    y = scipy.signal.step(([frequency**2], [1.0, 2 * damping * frequency, frequency**2]), T=t)[1]
    return float(delay + np.interp(1 - np.exp(-1), np.maximum.accumulate(y), t))
