"""Statistics of the residual: spectral lines, slow torques and bursts."""

import dataclasses as dc
from collections.abc import Sequence

import numpy as np
from scipy import ndimage, signal

from np_drake.diagnosis.residuals import FORCE, TORQUE, WRENCH, FlightResiduals, low_pass

NEIGHBOURHOOD = 1.2  # of a line, to either side at most [Hz]
OCTAVE = (
    2.0  # and at most this factor: slow noise is steep, and its level is another an octave away [1]
)
# but at least so many over the flight's length, for a line of a short flight is wide itself [1]
LOBE = 4.0
LOWEST, HIGHEST = 0.4, 15.0  # [Hz]
SLOW = 1.0  # torque below it is compared with that in `MIDDLE` [Hz]
MIDDLE = (4.0, 8.0)  # [Hz]
BRIEF = 1.5  # below it a force is asked for bursts [Hz]
EDGE = 1.0  # of a flight, where the filter errs [s]
NORMAL = 1.4826  # deviations of a normal variate that its median size is, inverted


@dc.dataclass(frozen=True)
class Line:
    """The strongest line of a channel: frequency [Hz], power over the median of its neighbours [1],
    RMS [unit].
    """

    channel: int
    frequency: float
    prominence: float
    rms: float


@dc.dataclass(frozen=True)
class Burst:
    """The largest deviation of a force from its median: axis, flight, time [s], size [N], and over
    noise's own [1].
    """

    axis: int
    flight: str
    time: float
    size: float
    prominence: float


def strongest_burst(flights: Sequence[FlightResiduals], residual: dict[str, np.ndarray]) -> Burst:
    """Return the largest slow force, axis by axis, over its usual deviation by the median of all
    flights.

    Args:
        residual: by flight, (m, 15) what a model leaves of it.
    """
    parts = []
    for e in flights:
        edge = min(round(EDGE / e.grid.step), (len(e.t) - 1) // 2)
        force = low_pass(residual[e.name][:, FORCE], e.grid.step, BRIEF)[edge : len(e.t) - edge]
        parts.append(force - np.median(force, axis=0))
    every = np.abs(np.concatenate(parts))
    usual = NORMAL * np.median(every, axis=0)
    ratio = np.divide(every, usual, out=np.zeros_like(every), where=usual > 0)
    row, axis = np.unravel_index(np.argmax(ratio), ratio.shape)
    ends = np.cumsum([len(f) for f in parts])
    k = int(np.searchsorted(ends, row, side="right"))
    e, i = flights[k], int(row) - (int(ends[k - 1]) if k else 0)
    first = (len(e.t) - len(parts[k])) // 2
    return Burst(
        int(axis), e.name, float(e.t[first + i]), float(every[row, axis]), float(ratio[row, axis])
    )


def strongest_line(
    flights: Sequence[FlightResiduals],
    residual: dict[str, np.ndarray],
    least: np.ndarray | None = None,
) -> Line:
    """Return the strongest line of force and torque in body axes, over all flights together.

    It is the bin of the mean periodogram with the largest ratio to the median about it, material
    where one is.

    Args:
        residual: by flight, (m, 15) what a model leaves of it.
        least: (6,) RMS of a material line [N, N·m]; default: any.
    """
    rate = 1.0 / flights[0].grid.step
    size = 2 ** int(np.ceil(np.log2(max(len(e.t) for e in flights))))
    power = np.zeros((size // 2 + 1, 6))
    for e in flights:
        y = residual[e.name][:, WRENCH] - residual[e.name][:, WRENCH].mean(axis=0)
        window = signal.windows.hann(len(y))[:, None]
        power += (
            np.abs(np.fft.rfft(y * window, size, axis=0)) ** 2 / np.sum(window**2) / len(flights)
        )
    frequency = np.fft.rfftfreq(size, 1 / rate)
    floor = _floor(power, frequency, LOBE / max(e.t[-1] - e.t[0] for e in flights))
    inside = (frequency > LOWEST) & (frequency < min(HIGHEST, 0.4 * rate))
    ratio = np.where(inside[:, None], power / np.maximum(floor, 1e-300), 0.0)
    rms = np.sqrt(2 * ndimage.convolve1d(power, np.ones(5), axis=0, mode="constant") / size)
    matters = ratio * (rms >= (0.0 if least is None else least))
    k, channel = np.unravel_index(np.argmax(matters if matters.any() else ratio), ratio.shape)
    return Line(int(channel), float(frequency[k]), float(ratio[k, channel]), float(rms[k, channel]))


def _floor(power: np.ndarray, frequency: np.ndarray, lobe: float) -> np.ndarray:
    """Return (f, 6) the median of the powers about every frequency; `lobe` the least distance to
    either side [Hz].
    """
    down = np.maximum(lobe, np.minimum(NEIGHBOURHOOD, frequency * (1 - 1 / OCTAVE)))
    up = np.maximum(lobe, np.minimum(NEIGHBOURHOOD, frequency * (OCTAVE - 1)))
    first = np.searchsorted(frequency, frequency - down)
    last = np.searchsorted(frequency, frequency + up, side="right")
    return np.stack([np.median(power[a:b], axis=0) for a, b in zip(first, last, strict=True)])


def slow_torque(
    flights: Sequence[FlightResiduals], residual: dict[str, np.ndarray]
) -> tuple[float, float, float, int]:
    """Return the largest ratio over axes of slow torque to that of gyro noise [1], its share [1],
    RMS [N·m], and axis.

    The share is of the slow torque of that axis before anything was explained. Differentiated white
    gyro noise, of a power proportional to frequency squared, is known from the middle band; noise
    of rotor speed is white.

    Args:
        residual: by flight, (m, 15) what a model leaves of it.
    """
    slow, middle, before = np.zeros(3), np.zeros(3), np.zeros(3)
    for e in flights:
        tau = residual[e.name][:, TORQUE] - residual[e.name][:, TORQUE].mean(axis=0)
        inside = slice(
            round(1 / (SLOW * e.grid.step)), -round(1 / (SLOW * e.grid.step))
        )  # without filter edges
        low = low_pass(tau, e.grid.step, SLOW)[inside]
        band = (low_pass(tau, e.grid.step, MIDDLE[1]) - low_pass(tau, e.grid.step, MIDDLE[0]))[
            inside
        ]
        first = e.y[:, TORQUE] - e.y[:, TORQUE].mean(axis=0)
        before += np.mean(low_pass(first, e.grid.step, SLOW)[inside] ** 2, axis=0)
        slow += np.mean(low**2, axis=0)
        middle += np.mean(band**2, axis=0)
    rotors = sum(2 * SLOW * e.grid.step * e.rotor_noise[TORQUE] ** 2 for e in flights)
    expected = SLOW**3 / (MIDDLE[1] ** 3 - MIDDLE[0] ** 3)
    ratio = slow / np.maximum(middle * expected + rotors, 1e-30)
    axis = int(np.argmax(ratio))
    rms = float(np.sqrt(slow[axis] / len(flights)))
    return float(np.sqrt(ratio[axis])), float(slow[axis] / max(before[axis], 1e-30)), rms, axis
