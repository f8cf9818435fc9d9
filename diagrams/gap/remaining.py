"""Statistics of the wrench that no cause explains, for a simulator to draw from."""

from collections.abc import Iterator

import numpy as np

from np_drake.diagnosis.result import Localisation
from np_drake.effects.disturbance import DisturbanceConfig

SHORTEST, LONGEST = 0.02, 20.0  # of a correlation time that a log can show [s]; own choice


def remaining_disturbance(where: Localisation) -> DisturbanceConfig:
    """Return deviation and correlation time of the residual after the causes, less the noise floor, in body axes."""
    size = [float(np.sqrt(max(c.after**2 - c.noise_floor**2, 0.0))) for c in where.channels]
    if len(size) != 6:  # no channel was judged
        return DisturbanceConfig()
    size = [value if np.isfinite(value) else 0.0 for value in size]
    times = [_correlation_time(where, k) for k in range(6)]
    return DisturbanceConfig(size[:3], size[3:], times[:3], times[3:])


def _correlation_time(where: Localisation, channel: int) -> float:
    """Return the lag at which the autocovariance of a channel has fallen to 1/e of that at the first lag [s].

    White noise of the sensors is in the variance alone, and so left out.
    """
    step, covariance = _autocovariance(where, channel)
    if not len(covariance) or covariance[0] <= 0:
        return SHORTEST
    below = np.flatnonzero(covariance < covariance[0] / np.e)
    lag = below[0] if len(below) else len(covariance) - 1
    return float(np.clip(lag * step, SHORTEST, LONGEST))


def _autocovariance(where: Localisation, channel: int) -> tuple[float, np.ndarray]:
    """Return the step [s] and the autocovariance at lags of one step on, mean of all flights."""
    flights = [(step, series[np.isfinite(series)]) for step, series in _series(where, channel)]
    flights = [(step, series - series.mean()) for step, series in flights if len(series) > 20]
    if not flights:
        return SHORTEST, np.zeros(0)
    step = flights[0][0]
    lags = min(int(LONGEST / step), min(len(series) for _, series in flights) // 2)
    total = sum(
        np.array([series[:-k] @ series[k:] / (len(series) - k) for k in range(1, lags)])
        for _, series in flights
    )
    return step, np.asarray(total) / len(flights)


def _series(where: Localisation, channel: int) -> Iterator[tuple[float, np.ndarray]]:
    for flight, t in where.times.items():
        if flight in where.after and len(t) > 1:
            yield float(np.median(np.diff(t))), where.after[flight][:, channel]
