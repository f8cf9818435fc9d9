"""Maximum a posteriori estimate of the grey-box model, its covariance by blocks of time, and the
spread of flights.

The cost is the sum of squared whitened residuals and of the standardised parameters. Filters and
weights follow from the residuals of the step before.
Source: Ljung, System Identification, ch. 7 (prediction errors); White 1982 (covariance of a
    misspecified model);
DerSimonian and Laird 1986 (variance between studies).
"""

import dataclasses as dc
from collections.abc import Mapping, Sequence

import numpy as np
import scipy

from np_drake.identification.model import FlightModel
from np_drake.vehicle.published import LogNormal, published_priors


@dc.dataclass(frozen=True)
class Parameter:
    """One coordinate of the model.

    name: as the model reads it.
    mean, sd: of its prior, in its own unit or, with `log`, of its logarithm. flight: whether each
        flight has its own.
    needs: what a log must hold for it, of `parts`; without it stays at its mean.
    """

    name: str
    mean: float
    sd: float
    log: bool = False
    flight: bool = False
    needs: tuple[str, ...] = ()

    def value(self, z: float) -> float:
        """Return the parameter at a standardised coordinate."""
        here = self.mean + self.sd * z
        return float(np.exp(here)) if self.log else float(here)


MOTORS = ("motors",)
BOTH = ("motors", "speed")
ROTOR_SPEED = ("speed",)


AIR = ("velocity",)


def parameters(spin: float, step: float) -> tuple[Parameter, ...]:
    """Return the parameters of the model with their priors.

    Lengths count in mean arms, inertia in mass times squared arm.

    Args:
        spin: rotor speed in hover, or an estimate [rad/s].
        step: between rows of the logs [s].
    """
    known = published_priors()
    moment = known.inertia
    zz = moment.mean + np.log(1.0 + known.inertia_pitch.median) + known.inertia_yaw.mean
    momentum = dc.replace(known.rotor_inertia, mean=known.rotor_inertia.mean - zz + np.log(spin))
    imu = ("accelerometer",)
    return (
        # Thrust over mass, over that which hovers on the mean input.
        Parameter("scale", 0.0, 1.0, log=True),
        # Gains of the rotors against each other: left to right, front to rear, by direction.
        *(Parameter(f"gain_{axis}", 0.0, 0.03) for axis in ("roll", "pitch", "yaw")),
        *(Parameter(f"com_{axis}", 0.0, 0.05) for axis in "xyz"),
        # Jxx of any vehicle; Jyy over it, with the variance that both share; Jzz over their sum,
        # which a flat vehicle reaches.
        _published("jxx", moment),
        _published("jyy", known.inertia_pitch),
        _published("jzz", known.inertia_yaw),
        # Products over the mean of jxx and jyy.
        *(Parameter(name, 0.0, 0.03) for name in ("jxy", "jxz", "jyz")),
        # Torque over thrust of a rotor, over its radius.
        _published("torque", known.torque_lever),
        # Yaw of motors that lean, over their torque.
        *(Parameter(f"lean_{axis}", 0.0, 0.2) for axis in "xy"),
        # Angular momentum of a rotor in hover, over jzz [rad/s].
        _published("rotor_momentum", momentum),
        *(Parameter(f"imu_{axis}", 0.0, 0.2, needs=imu) for axis in "xyz"),
        *(Parameter(f"tilt_{axis}", 0.0, 0.03, needs=imu) for axis in "xyz"),
        # What couples roll, pitch and yaw besides tilt and products of inertia.
        *(Parameter(f"twist_{axis}", 0.0, 0.03) for axis in "xyz"),
        # Force and moment against velocity, over mass [1/s, 1/s, 1/m, arms/s, arms/s].
        *(Parameter(name, 0.15, 0.15, needs=AIR) for name in ("drag", "climb")),
        Parameter("lift", 0.0, 0.1, needs=AIR),
        *(Parameter(f"flap_{axis}", 0.0, 0.2, needs=AIR) for axis in "xy"),
        # Times [s]: command to body, accelerometer after gyro, first-order lags. The accelerometer
        # averages over a window, of the interval of rows.
        Parameter("delay", 0.005, 0.01, needs=MOTORS),
        Parameter("force_late", 0.0, 0.005 + 0.3 * step),
        Parameter("window", 0.5, 0.3, needs=imu),
        _published("lag", known.time_constant, MOTORS),
        _published("lag_ratio", known.time_constant_down, MOTORS),
        Parameter("curve", 0.2, 0.3, needs=("throttle",)),
        Parameter("idle", 0.05, 0.04, needs=("throttle",)),
        # Thrust over a collective command; a power of 1.5 ± 0.5 has these, as `logs.inputs` says.
        Parameter("slope", 1.5, 0.5, needs=("collective",)),
        Parameter("bend", 0.375, 0.5, needs=("collective",)),
        Parameter("sag", 1.5, 0.5, needs=("voltage",)),
        Parameter("full_speed", 0.0, 0.5, log=True, needs=BOTH),
        # Of one flight against all: thrust by its battery, centre of mass, gain about z.
        Parameter("charge", 0.0, 0.03, log=True, flight=True),
        *(Parameter(f"shift_{axis}", 0.0, 0.02, flight=True) for axis in ("x", "y", "yaw")),
        # Of one flight: rotor speed to body [s].
        Parameter("clock", 0.0, 0.01, flight=True, needs=ROTOR_SPEED),
        # Axes of the logged attitude against the body's [rad]; an estimator's may be its sensors'.
        *(
            Parameter(name, 0.0, 0.03, flight=True, needs=AIR)
            for name in ("level_x", "level_y", "heading")
        ),
        *(Parameter(f"bias_{axis}", 0.0, 0.3, flight=True) for axis in "xy"),
        Parameter("bias_z", 0.0, 0.1, flight=True),
    )


def _published(name: str, prior: LogNormal, needs: tuple[str, ...] = ()) -> Parameter:
    """Return a positive parameter with the prior of published vehicles."""
    return Parameter(name, prior.mean, prior.deviation, log=True, needs=needs)


@dc.dataclass(frozen=True)
class Layout:
    """Places of the parameters in the vector z of standardised coordinates, theta = mean + sd z.

    shared: parameters of all flights.
    per_flight: parameters of each flight.
    flights: their number.
    fixed: values of those that these logs cannot tell.
    """

    shared: tuple[Parameter, ...]
    per_flight: tuple[Parameter, ...]
    flights: int
    fixed: Mapping[str, float] = dc.field(default_factory=dict)

    @classmethod
    def of(cls, parameters: Sequence[Parameter], parts: set[str], flights: int) -> "Layout":
        """Return the layout of the parameters that logs can tell."""
        acting = [p for p in parameters if parts.issuperset(p.needs)]
        fixed = {p.name: p.value(0.0) for p in parameters if p not in acting}
        return cls(
            tuple(p for p in acting if not p.flight),
            tuple(p for p in acting if p.flight),
            flights,
            fixed,
        )

    @property
    def size(self) -> int:
        """Length of z."""
        return len(self.shared) + self.flights * len(self.per_flight)

    @property
    def names(self) -> list[str]:
        """Names of the shared parameters."""
        return [p.name for p in self.shared]

    def indices(self, flight: int) -> np.ndarray:
        """Return the places in z on which a flight depends."""
        first = len(self.shared) + flight * len(self.per_flight)
        return np.r_[np.arange(len(self.shared)), np.arange(first, first + len(self.per_flight))]

    def values(self, z: np.ndarray, flight: int | None = None) -> dict[str, float]:
        """Return parameters by name, those that these logs cannot tell included.

        Args:
            z: (size,) standardised coordinates.
            flight: whose own parameters are included; None: the mean of those of all flights.
        """
        shared, each = np.split(z, [len(self.shared)])
        each = each.reshape(self.flights, len(self.per_flight))
        coordinates = each.mean(axis=0) if flight is None else each[flight]
        both = zip((*self.shared, *self.per_flight), (*shared, *coordinates), strict=True)
        return {**self.fixed, **{p.name: p.value(c) for p, c in both}}


WHITENING_ORDER = 16  # of the autoregressive model; own choice: 0.16 s at 100 Hz
OUTLYING = 3.0  # standard deviations from which a whitened residual counts less; Huber's bend
# noise below which no channel is [m/s², rad/s², 1]; source: sensors have ten times as much
LEAST_NOISE = 1e-4
# from which it does not count; own choice: a Gaussian has none in a thousand years of flight
IMPOSSIBLE = 8.0


@dc.dataclass(frozen=True)
class Whitening:
    """Filters of the channels of one flight.

    taps: (c, p + 1) filter of each channel that maps it to unit white noise.
    good: (m,) rows that count. weight: (m, c) square root of Huber's weights [1].
    """

    taps: np.ndarray
    good: np.ndarray
    weight: np.ndarray

    @classmethod
    def of(cls, e: np.ndarray, good: np.ndarray, order: int = WHITENING_ORDER) -> "Whitening":
        """Return the filters that whiten residuals.

        Args:
            e: (m, c) residuals.
            good: (m,) rows that count.
        """
        # A constant is what parameters are to explain, not noise.
        deviation = np.where(good[:, None], e - (e[good].mean(axis=0) if good.any() else 0.0), 0.0)
        usual = (
            np.median(np.abs(deviation[good]), axis=0) / 0.6745
            if good.any()
            else np.ones(e.shape[1])
        )
        bounded = np.clip(deviation, -IMPOSSIBLE * usual, IMPOSSIBLE * usual)
        taps = np.stack([_filter(column, good, order) for column in bounded.T])
        reach = np.convolve(~good, np.ones(order + 1))[: len(good)]
        kept = (reach < 0.5) & (np.arange(len(good)) >= order)
        size = np.abs(cls(taps, kept, np.ones(e.shape)).apply(deviation))
        spread = np.median(size[kept], axis=0) / 0.6745 if kept.any() else np.ones(e.shape[1])
        spread = np.maximum(spread, LEAST_NOISE * taps[:, 0])
        ratio = size / spread
        weight = np.sqrt(np.minimum(1.0, OUTLYING / np.maximum(ratio, 1e-12))) / spread
        weight[ratio > IMPOSSIBLE] = 0.0
        return cls(taps, kept, weight)

    def apply(self, values: np.ndarray) -> np.ndarray:
        """Return whitened channels, zero where rows do not count.

        Args:
            values: (m, c) channels, or how they change with a parameter.
        """
        filtered = zip(self.taps, values.T, strict=True)
        out = np.stack([scipy.signal.lfilter(taps, 1.0, v) for taps, v in filtered], axis=1)
        return out * np.where(self.good[:, None], self.weight, 0.0)


def _filter(x: np.ndarray, good: np.ndarray, order: int) -> np.ndarray:
    """Return the prediction error filter (order + 1,) of a channel, over its deviation.

    Args:
        x: (m,) the channel, zero where rows do not count.
        good: (m,) rows that count.
    """
    n = max(int(good.sum()), 1)
    r = np.array([x[: len(x) - k] @ x[k:] for k in range(order + 1)]) / n
    if r[0] <= 0.0:
        return np.append(1.0, np.zeros(order))
    r[0] *= 1.0 + 1e-9
    phi = scipy.linalg.solve_toeplitz(r[:-1], r[1:])
    return np.append(1.0, -phi) / np.sqrt(max(r[0] - phi @ r[1:], 1e-12 * r[0]))


PRIOR_FLIGHTS = 2  # that the variance between flights is worth before any is seen; own choice


@dc.dataclass(frozen=True)
class Agreement:
    """Whether flights tell the same of one parameter.

    values, sd: (f,) what each flight tells alone and its deviation, in z; NaN where it tells
    nothing.
    variance: between flights, beside that within them.
    p: probability of a larger disagreement by chance [1].
    """

    values: np.ndarray
    sd: np.ndarray
    variance: float
    p: float


def compare(values: np.ndarray, sd: np.ndarray) -> Agreement | None:
    """Return the agreement of flights on a parameter; None where fewer than two tell anything.

    Args:
        values: (f,) what each tells alone; NaN where it tells nothing.
        sd: (f,) standard deviations of these.
    """
    here = np.isfinite(values)
    if here.sum() < 2:
        return None
    variance, Q = random_effect(values[here], sd[here])
    return Agreement(values, sd, variance, float(scipy.stats.chi2.sf(Q, here.sum() - 1)))


def random_effect(values: np.ndarray, sd: np.ndarray) -> tuple[float, float]:
    """Return the variance between flights beside that within them, and Cochran's Q.

    Args:
        values: (f,) what each tells alone.
        sd: (f,) standard deviations of these.
    """
    weight = 1.0 / sd**2
    Q = float(weight @ (values - weight @ values / weight.sum()) ** 2)
    spread = weight.sum() - (weight**2).sum() / weight.sum()
    return max(0.0, (Q - (len(values) - 1)) / spread), Q


def _between(agreement: Agreement) -> float:
    """Return what the variance between flights adds to that of their mean, with Student's t for
    their number.
    """
    here = np.isfinite(agreement.sd)
    weight = 1.0 / agreement.sd[here] ** 2  # as flights count in the common estimate
    share = float((weight**2).sum() / weight.sum() ** 2)
    return agreement.variance * share * _student(int(here.sum()) - 1 + PRIOR_FLIGHTS) ** 2


def _student(freedom: int) -> float:
    """Return by how much a 95 % interval is wider with few degrees of freedom than with many."""
    return float(scipy.stats.t.ppf(0.975, freedom) / scipy.stats.norm.ppf(0.975))


PASSES = 4  # of noise models
GAUSS_NEWTON_STEPS = 3  # of Gauss-Newton within one
DIFFERENCE_STEP = 1e-4  # of a finite difference, in standard deviations of the prior
# length of the blocks into which a flight's scores are summed [s]; own choice: a manoeuvre
SCORE_BLOCK = 1.0
# blocks that are taken as dependent; own choice: up to the slow errors of an estimator
TOGETHER = 1, 3, 9
# of one length from which they tell a covariance; own choice: Student's factor is then 1.2
LEAST_SCORE_BLOCKS = 8
LEAST_FLIGHTS = 5  # from which flights are taken as independent clusters; own choice
LARGEST = 2.0  # step in standard deviations of the prior
BOUND = 6.0  # standard deviations of the prior beyond which a parameter does not go
SETTLED = 1e-3  # largest step at which the descent ends


@dc.dataclass(frozen=True)
class Estimate:
    """Parameters of the model on some flights.

    z: (k,) standardised coordinates.
    covariances: (k, k) of z, by what is taken as independent: innovations, blocks of several
        lengths and, of enough flights, these; all but the first widened by Student's t for their
        number. The variance of anything is the largest.
    information: (k, k) of the data alone. agreement: by shared parameter, how the flights agree;
        only where two or more tell it.
    """

    layout: Layout
    z: np.ndarray
    covariances: tuple[np.ndarray, ...]
    information: np.ndarray
    agreement: dict[str, Agreement] = dc.field(default_factory=dict)

    def variance(self, gradient: np.ndarray) -> float:
        """Return the variance of a quantity with the derivatives `gradient` (k,) by z."""
        return float(max(gradient @ c @ gradient for c in self.covariances))


def estimate(models: Sequence[FlightModel], layout: Layout) -> Estimate:
    """Return the estimate of all flights together."""
    z = np.zeros(layout.size)
    alone = [z] * len(models)
    for turn in range(PASSES):
        whitenings = []
        for number, (model, z_alone) in enumerate(zip(models, alone, strict=True)):
            if turn:
                model.smooth(layout.values(z_alone, number))
            # What this flight alone leaves: a disagreement with others is not its noise.
            whitenings.append(
                Whitening.of(model.residual(layout.values(z_alone, number)), model.flight.good)
            )
        before = z
        z, parts = _descend(models, layout, z, whitenings)
        alone = [_alone(part, layout, z, number)[0] for number, part in enumerate(parts)]
        if np.abs(z - before).max() < 0.02:
            break
    information = np.sum([part.information for part in parts], axis=0)
    inverse = np.linalg.inv(information + np.eye(layout.size))
    single = parts
    if len(parts) > 1:
        flights = zip(models, alone, whitenings, strict=True)
        single = [
            _part(model, layout, z_alone, number, w)
            for number, (model, z_alone, w) in enumerate(flights)
        ]
    agreement = _agreement(single, layout, alone)
    covariances = [inverse]
    for together in TOGETHER:
        scores = np.concatenate(
            [
                np.add.reduceat(part.scores, np.arange(0, len(part.scores), together))
                for part in single
            ]
        )
        if together == 1 or len(scores) >= LEAST_SCORE_BLOCKS:
            covariances.append(_sandwich(inverse, scores))
    # What disagreement adds to the variances of z (k,): between flights, and of what is their own.
    between = np.zeros(layout.size)
    for name, comparison in agreement.items():
        between[layout.names.index(name)] = _between(comparison)
    for i in range(len(layout.per_flight) if layout.flights > 1 else 0):
        each = slice(len(layout.shared) + i, None, len(layout.per_flight))
        beyond = np.var(z[each], ddof=1) - np.mean(np.diag(covariances[1])[each])
        between[each] = max(float(beyond), 0.0)
    covariances = [c + np.diag(between) for c in covariances]
    # The gradients of flights at the common estimate hold the differences between them.
    if len(parts) >= LEAST_FLIGHTS:
        covariances.append(_sandwich(inverse, np.stack([part.gradient for part in parts])))
    # Whatever flights leave, vehicles lie as the prior says.
    return Estimate(
        layout, z, tuple(map(_not_above_the_prior, covariances)), information, agreement
    )


def _not_above_the_prior(covariance: np.ndarray) -> np.ndarray:
    """Return the covariance (k, k) of z with no deviation above that of the prior, 1."""
    known = np.minimum(1.0 / np.sqrt(np.diag(covariance)), 1.0)
    return covariance * np.outer(known, known)


def _sandwich(inverse: np.ndarray, scores: np.ndarray, few: float | None = None) -> np.ndarray:
    """Return the covariance (k, k) with independent scores (c, k).

    Args:
        inverse: (k, k) of the information with that of the prior.
        few: by which deviations are wider [1]; default: by Student's t for the number of scores.
    Source: White 1982; the prior counts as data.
    """
    count = max(len(scores), 2)
    apart = scores - scores.mean(axis=0)
    few = _student(count - 1) if few is None else few
    middle = few**2 * apart.T @ apart * count / (count - 1) + np.eye(len(inverse))
    return inverse @ middle @ inverse


@dc.dataclass(frozen=True)
class _Part:
    """Share of one flight in the normal equations: gradient (k,), information (k, k) and scores of
    blocks (b, k).
    """

    gradient: np.ndarray
    information: np.ndarray
    scores: np.ndarray


def _descend(
    models: Sequence[FlightModel], layout: Layout, z: np.ndarray, whitenings: Sequence[Whitening]
) -> tuple[np.ndarray, list[_Part]]:
    """Return the minimum of the cost with these filters, and the flights' shares in the equations
    there.

    Without damping at first, unlike `minimise` of the diagnosis: coordinates that look the same are
    told apart by the prior alone, to which any damping by the size of their information is large.
    """
    flights = list(zip(models, whitenings, strict=True))

    def cost(at: np.ndarray) -> float:
        apart = (
            w.apply(m.residual(layout.values(at, number))) for number, (m, w) in enumerate(flights)
        )
        return 0.5 * float(at @ at) + sum(0.5 * float(np.sum(e**2)) for e in apart)

    def shares(at: np.ndarray) -> list[_Part]:
        return [_part(m, layout, at, number, w) for number, (m, w) in enumerate(flights)]

    damping = 0.0
    parts = shares(z)
    before = cost(z)
    for _ in range(GAUSS_NEWTON_STEPS):
        H = sum(p.information for p in parts) + np.eye(layout.size)
        g = sum(p.gradient for p in parts) + z
        for _ in range(5):
            step = -np.linalg.solve(H + damping * np.diag(np.diag(H)), g)
            step *= min(1.0, LARGEST / max(np.abs(step).max(), 1e-12))
            new = np.clip(z + step, -BOUND, BOUND)
            after = cost(new)
            if after < before:
                break
            damping = max(10 * damping, 1e-3)
        else:
            break
        z = new
        before = after
        damping = 0.1 * damping
        parts = shares(new)
        if np.abs(step).max() < SETTLED:
            break
    return z, parts


def _part(
    model: FlightModel, layout: Layout, z: np.ndarray, number: int, whitening: Whitening
) -> _Part:
    """Return the share of one flight in the normal equations."""
    e = model.residual(layout.values(z, number))
    indices = layout.indices(number)
    J = np.empty((len(indices), *e.shape))
    for column, i in enumerate(indices):
        moved = z.copy()
        moved[i] += DIFFERENCE_STEP
        J[column] = whitening.apply(
            (model.residual(layout.values(moved, number)) - e) / DIFFERENCE_STEP
        )
    each = np.einsum("kmc,mc->mk", J, whitening.apply(e))
    rows = max(1, round(SCORE_BLOCK / model.flight.step))
    blocks = np.add.reduceat(each, np.arange(0, len(each), rows))
    k = layout.size
    information = np.zeros((k, k))
    gradient = np.zeros(k)
    scores = np.zeros((len(blocks), k))
    flat = J.reshape(len(indices), -1)
    information[np.ix_(indices, indices)] = flat @ flat.T
    gradient[indices] = each.sum(axis=0)
    scores[:, indices] = blocks
    return _Part(gradient, information, scores)


def _alone(
    part: _Part, layout: Layout, z: np.ndarray, number: int
) -> tuple[np.ndarray, np.ndarray]:
    """Return what a flight alone tells (k,), by one step from z (k,), and the inverse of its
    Hessian.
    """
    indices = layout.indices(number)
    inverse = np.linalg.inv(part.information[np.ix_(indices, indices)] + np.eye(len(indices)))
    moved = z.copy()
    moved[indices] = np.clip(
        z[indices] - inverse @ (part.gradient[indices] + z[indices]), -BOUND, BOUND
    )
    return moved, inverse


def _agreement(
    parts: Sequence[_Part], layout: Layout, alone: Sequence[np.ndarray]
) -> dict[str, Agreement]:
    """Return how flights agree: what each tells alone, less what the prior tells.

    Args:
        alone: estimates (k,) of the flights.
    """
    if len(parts) < 2:
        return {}
    n = len(layout.shared)
    values = np.full((len(parts), n), np.nan)
    sds = np.full((len(parts), n), np.nan)
    for number, part in enumerate(parts):
        indices = layout.indices(number)
        moved, inverse = _alone(part, layout, alone[number], number)
        sandwich = _sandwich(inverse, part.scores[:, indices], 1.0)
        variance = np.maximum(np.diag(sandwich), np.diag(inverse))[:n]
        observable = variance < 0.25
        free = variance / np.maximum(1.0 - variance, 1e-9)  # of the prior
        values[number] = np.where(observable, moved[:n] * free / variance, np.nan)
        sds[number] = np.where(observable, np.sqrt(np.maximum(free, 1e-18)), np.nan)
    return {
        p.name: agreement
        for i, p in enumerate(layout.shared)
        if (agreement := compare(values[:, i], sds[:, i])) is not None
    }
