"""How strong and how long gusts are: the likelihood of a Gauss-Markov force under white noise, its mean unknown."""

import dataclasses as dc
from collections.abc import Mapping, Sequence

import numpy as np
from scipy import linalg, optimize, stats

from np_drake import attitude
from np_drake.diagnosis.evidence import FORCE, Evidence
from np_drake.diagnosis.hidden_swing import attitude_on_grid
from np_drake.rigid_body import P, V

BIN = 0.1  # over which the force is averaged [s]
SPAN = 20.0  # what lies farther apart counts as independent [s]
SHORTEST, LONGEST = 0.1, 20.0  # correlation time [s]
CALM = 2.0  # that is quiet at least before a wind that begins in flight [s]
MOST = 300  # instants that are tried
GAIN = 8.0  # in log likelihood that a better one must bring; own choice
STEP = 0.02  # of the logarithms, for their curvature [1]
TINY = 1e-9  # [m], for a height that is kept
Z = 1.96  # deviations to either side: 95 %


@dc.dataclass(frozen=True)
class WindForce:
    """Force in W on a vehicle that feels a wind. mean (3, 2): axes by value and half width of the 95 % interval [N].

    deviation [N], correlation_time [s]: value, lower and upper end; of a first-order Gauss-Markov process.
    white: deviation of a bin's noise [N].
    """

    mean: np.ndarray
    deviation: tuple[float, float, float]
    correlation_time: tuple[float, float, float]
    white: float


def wind_force(
    flights: Sequence[Evidence], left: Mapping[str, np.ndarray], begins: Mapping[str, float | None]
) -> WindForce:
    """Of what is left (m, 15) of the flights, from when the wind begins on [s].

    Source: restricted maximum likelihood, the mean of each axis taken out; the intervals by its curvature in the
    logarithms. Deviation and correlation time are those of the two level axes together.
    """
    spans = [span for e in flights for span in _spans(e, left[e.name], begins.get(e.name))]
    level = [span[:, :2] for span in spans]
    size = float(np.sqrt(np.mean(np.concatenate(level).var(axis=0))))
    start = np.log([size, 1.0, 0.3 * size])
    reach = [(start[0] - 4, start[0] + 3), (np.log(SHORTEST), np.log(LONGEST)), (start[0] - 6, start[0] + 1)]

    def loss(z: np.ndarray) -> float:
        return _restricted_loss(level, *np.exp(z))

    best = optimize.minimize(loss, start, method="L-BFGS-B", bounds=reach).x
    deviation, time, white = np.exp(best)
    wide = np.exp(Z * np.sqrt(np.diag(np.linalg.inv(_curvature(loss, best)))))
    value, variance = _mean(spans, deviation, time, white)
    half = np.full(3, Z * np.sqrt(variance))
    return WindForce(
        np.stack([value, half], axis=1),
        (float(deviation), float(deviation / wide[0]), float(deviation * wide[0])),
        (float(time), float(time / wide[1]), float(time * wide[1])),
        float(white),
    )


def wind_onset(e: Evidence, left: np.ndarray, begin: float | None, wind: WindForce) -> float | None:
    """When the wind begins that was taken to begin at `begin` [s] (None: from the start; infinite: not at all).

    Until then there is noise. Gusts show by their power at once, where their mean, by which an onset is found first,
    may take a second, or miss it. That stays where a better one gains little: it was found beside the drag, which is
    felt without gusts as well.
    left: (m, 15) what is left of the flight.
    """
    bins = _bins(e, left, e.t >= e.t[0])[:, :2]
    t = e.t[0] + BIN * np.arange(len(bins))
    tried = np.flatnonzero((t > e.t[0] + CALM) & (t < t[-1] - 1.0))
    tried = tried[:: max(1, -(-len(tried) // MOST))]
    here = 0 if begin is None else int(np.argmin(np.abs(t - min(begin, t[-1]))))
    factor = _factor(len(bins), wind.deviation[0], wind.correlation_time[0], wind.white)
    logdet = np.cumsum(2 * np.log(np.diag(factor)))
    power = np.concatenate([[0.0], np.cumsum(np.sum(bins**2, axis=1))])

    def loss(k: int) -> float:
        n = len(bins) - k
        after = linalg.solve_triangular(factor[:n, :n], bins[k:] - wind.mean[:2, 0], lower=True)
        noise = max(wind.white**2, power[k] / max(2 * k, 1))
        return float(power[k] / noise + 2 * k * np.log(noise) + np.sum(after**2) + 2 * logdet[n - 1])

    losses = {k: loss(k) for k in (here, 0, *tried.tolist())}
    best = min(losses, key=losses.__getitem__)
    if losses[here] - losses[best] <= 2 * GAIN:
        return begin
    return float(t[best]) if best else None


def chance_of_place(flights: Sequence[Evidence], left: Mapping[str, np.ndarray], wind: WindForce) -> float:
    """Probability that gusts, which do not know where the vehicle is, follow its place as much as this force does [1].

    Source: likelihood ratio of a level force that is quadratic in the position (a jet pushes in the middle of a
    flight, which nothing linear tells) beside gusts, a mean in each span and a force linear in the velocity (a drag
    may be found too weak), under the gusts' covariance: half a chi-squared of at most eighteen.
    left: (m, 15) what is left of the flights.
    """
    x = np.concatenate([e.rows.x[:, P] for e in flights])
    middle, size = x.mean(axis=0), x.std(axis=0) + TINY
    white = []
    for e in flights:
        force = _bins(e, left[e.name], np.ones(len(e.t), bool))[:, :2]
        place = (_on_bins(e, P) - middle) / size
        columns = np.hstack([force, _on_bins(e, V), place, _products(place)])
        white += [_about_its_mean(span, wind) for span in _split(columns)]
    force, drag, place = np.split(np.concatenate(white), [2, 5], axis=1)
    less, more = linalg.orth(drag), linalg.orth(np.hstack([drag, place]))
    gain = np.sum((more.T @ force) ** 2) - np.sum((less.T @ force) ** 2)
    return float(stats.chi2.sf(gain, 2 * (more.shape[1] - less.shape[1])))


def _about_its_mean(span: np.ndarray, wind: WindForce) -> np.ndarray:
    """(k, a) columns whitened, without what is constant before it was."""
    factor = _factor(len(span), wind.deviation[0], wind.correlation_time[0], wind.white)
    white = linalg.solve_triangular(factor, np.column_stack([span, np.ones(len(span))]), lower=True)
    one = white[:, -1:]
    return white[:, :-1] - one @ (one.T @ white[:, :-1]) / np.sum(one**2)


def _products(x: np.ndarray) -> np.ndarray:
    """(k, 6) of every two of three columns."""
    i, j = np.triu_indices(3)
    return x[:, i] * x[:, j]


def _on_bins(e: Evidence, columns: slice) -> np.ndarray:
    """(k, 3) of the state, in bins."""
    return _binned(e, np.stack([np.interp(e.t, e.rows.t, axis) for axis in e.rows.x[:, columns].T], axis=1))


def _spans(e: Evidence, left: np.ndarray, begin: float | None) -> list[np.ndarray]:
    """(k, 3) forces in W in bins, of spans of at most `SPAN` [N]."""
    return _split(_bins(e, left, e.t >= (e.t[0] if begin is None else begin)))


def _split(bins: np.ndarray) -> list[np.ndarray]:
    most = round(SPAN / BIN)
    return [bins[i : i + most] for i in range(0, len(bins), most) if len(bins) - i > 1]


def _bins(e: Evidence, left: np.ndarray, rows: np.ndarray) -> np.ndarray:
    """(k, 3) force in W of these rows (m,), averaged over bins [N]."""
    return _binned(e, attitude.rotate(attitude_on_grid(e), left[:, FORCE])[rows])


def _binned(e: Evidence, values: np.ndarray) -> np.ndarray:
    """(k, 3) means over bins of values (m, 3) on the grid."""
    size = max(1, round(BIN / e.grid.step))
    return values[: len(values) // size * size].reshape(-1, size, 3).mean(axis=1)


def _factor(n: int, deviation: float, time: float, white: float) -> np.ndarray:
    """(n, n) lower Cholesky factor of the covariance of n bins, in each of which the process is averaged."""
    b = BIN / time
    column = 2 * (np.cosh(b) - 1) / b**2 * np.exp(-np.arange(n) * b)
    column[0] = 2 * (b - 1 + np.exp(-b)) / b**2
    column *= deviation**2
    column[0] += white**2
    return linalg.cholesky(linalg.toeplitz(column), lower=True)


def _whitened(spans: Sequence[np.ndarray], deviation, time, white) -> tuple[np.ndarray, np.ndarray, float]:
    """Forces (k, a) and ones (k,) whitened, all spans in a row, and the log determinant of their covariance."""
    factors = {n: _factor(n, deviation, time, white) for n in {len(s) for s in spans}}
    both = [
        linalg.solve_triangular(factors[len(s)], np.column_stack([s, np.ones(len(s))]), lower=True)
        for s in spans
    ]
    whole = np.concatenate(both)
    return whole[:, :-1], whole[:, -1], sum(2 * np.log(np.diag(factors[len(s)])).sum() for s in spans)


def _restricted_loss(spans: Sequence[np.ndarray], deviation: float, time: float, white: float) -> float:
    F, one, logdet = _whitened(spans, deviation, time, white)
    weight = one @ one
    power = np.sum(F**2) - np.sum((one @ F) ** 2) / weight
    return float(0.5 * (power + F.shape[1] * (logdet + np.log(weight))))


def _mean(spans: Sequence[np.ndarray], deviation, time, white) -> tuple[np.ndarray, float]:
    """(3,) by generalised least squares, and its variance."""
    F, one, _ = _whitened(spans, deviation, time, white)
    return one @ F / (one @ one), float(1.0 / (one @ one))


def _curvature(loss, z: np.ndarray) -> np.ndarray:
    """(k, k) second derivatives by central differences, with a weak prior: a figure may not matter at all."""
    k = len(z)
    E = STEP * np.eye(k)
    H = np.empty((k, k))
    for i in range(k):
        for j in range(i + 1):
            four = (
                loss(z + E[i] + E[j]) - loss(z + E[i] - E[j]) - loss(z - E[i] + E[j]) + loss(z - E[i] - E[j])
            )
            H[i, j] = H[j, i] = four / (4 * STEP**2)
    values, vectors = np.linalg.eigh(H)
    return vectors @ np.diag(np.maximum(values, 0.25)) @ vectors.T
