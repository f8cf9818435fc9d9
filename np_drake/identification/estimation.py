"""Maximum a posteriori estimate of the grey-box model, its covariance by blocks of time, and the
spread of flights.

The cost is the sum of squared whitened residuals and of the standardised parameters. Filters and
weights follow from the residuals of the step before.
Source: Ljung, System Identification, ch. 7 (prediction errors).
"""

import dataclasses as dc
from collections.abc import Collection, Mapping, Sequence

import numpy as np

from np_drake.estimation.map_fit import (
    SCORE_BLOCK,
    Agreement,
    between_variance,
    clustered_covariances,
    compare,
    minimise,
    sandwich,
)
from np_drake.estimation.noise import RobustNoise
from np_drake.estimation.priors import HEALTHY
from np_drake.identification.model import FlightModel
from np_drake.vehicle.published import LogNormal, published_priors
from np_drake.vehicle.vehicle import (
    THROTTLE_POWER,
    THROTTLE_POWER_SCATTER,
    VOLTAGE,
    VOLTAGE_SCATTER,
)


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


def parameters(spin: float, step: float, parts: Collection[str] = ()) -> tuple[Parameter, ...]:
    """Return the parameters of the model with their priors, of `HEALTHY` and of published vehicles.

    Lengths count in mean arms, inertia in mass times squared arm.

    Args:
        spin: rotor speed in hover, or an estimate [rad/s].
        step: between rows of the logs [s].
        parts: what the logs hold, of `identify`.
    """
    known = published_priors()
    moment = known.inertia
    zz = moment.mean + np.log(1.0 + known.inertia_pitch.median) + known.inertia_yaw.mean
    momentum = dc.replace(known.rotor_inertia, mean=known.rotor_inertia.mean - zz + np.log(spin))
    imu = ("accelerometer",)
    # A difference between two rotors and the two others is the mean of four.
    gain = HEALTHY.rotor_gain / 2
    plane = HEALTHY.center_of_mass
    charge = HEALTHY.known_charge if {"speed", "newtons"} & {*parts} else HEALTHY.charge
    bias = float(np.hypot(HEALTHY.accelerometer_offset, HEALTHY.accelerometer))
    return (
        # Thrust over mass, over that which hovers on the mean input.
        Parameter("scale", 0.0, 1.0, log=True),
        # Gains of the rotors against each other: left to right, front to rear, by direction.
        *(Parameter(f"gain_{axis}", 0.0, gain) for axis in ("roll", "pitch", "yaw")),
        Parameter("com_x", 0.0, plane),
        Parameter("com_y", 0.0, plane),
        Parameter("com_z", 0.0, HEALTHY.center_of_mass_height),
        # Jxx of any vehicle; Jyy over it, with the variance that both share; Jzz over their sum,
        # which a flat vehicle reaches.
        _published("jxx", moment),
        _published("jyy", known.inertia_pitch),
        _published("jzz", known.inertia_yaw),
        # Products over the mean of jxx and jyy.
        *(Parameter(name, 0.0, HEALTHY.product_of_inertia) for name in ("jxy", "jxz", "jyz")),
        # Torque over thrust of a rotor, over its radius.
        _published("torque", known.torque_lever),
        # Yaw of motors that lean, over their torque.
        *(Parameter(f"lean_{axis}", 0.0, HEALTHY.lean) for axis in "xy"),
        # Angular momentum of a rotor in hover, over jzz [rad/s].
        _published("rotor_momentum", momentum),
        *(Parameter(f"imu_{axis}", 0.0, HEALTHY.imu_position, needs=imu) for axis in "xyz"),
        *(Parameter(f"tilt_{axis}", 0.0, HEALTHY.mounting, needs=imu) for axis in "xyz"),
        # What couples roll, pitch and yaw besides tilt and products of inertia.
        *(Parameter(f"twist_{axis}", 0.0, HEALTHY.gyro_axes) for axis in "xyz"),
        # Force and moment against velocity, over mass [1/s, 1/s, 1/m, arms/s, arms/s].
        *(Parameter(name, HEALTHY.drag, HEALTHY.drag, needs=AIR) for name in ("drag", "climb")),
        Parameter("lift", 0.0, HEALTHY.lift, needs=AIR),
        *(Parameter(f"flap_{axis}", 0.0, HEALTHY.flapping, needs=AIR) for axis in "xy"),
        # Times [s]: command to body, accelerometer after gyro, first-order lags. The accelerometer
        # averages over a window, of the interval of rows.
        Parameter("delay", 0.005, HEALTHY.command_time, needs=MOTORS),
        Parameter("force_late", 0.0, HEALTHY.accelerometer_time + 0.3 * step),
        Parameter("window", 0.5, 0.3, needs=imu),
        _published("lag", known.time_constant, MOTORS),
        _published("lag_ratio", known.time_constant_down, MOTORS),
        Parameter("curve", 0.2, HEALTHY.linear_throttle, needs=("throttle",)),
        Parameter("idle", 0.05, HEALTHY.idle, needs=("throttle",)),
        # Thrust over a collective command; the powers of `THROTTLE_POWER` have these.
        Parameter("slope", THROTTLE_POWER, THROTTLE_POWER_SCATTER, needs=("collective",)),
        Parameter("bend", 0.375, 0.5, needs=("collective",)),
        Parameter("sag", VOLTAGE, VOLTAGE_SCATTER, needs=("voltage",)),
        Parameter("full_speed", 0.0, HEALTHY.full_speed, log=True, needs=BOTH),
        # Of one flight against all: thrust by its battery, centre of mass, gain about z.
        Parameter("charge", 0.0, charge, log=True, flight=True),
        *(
            Parameter(f"shift_{axis}", 0.0, HEALTHY.center_of_mass_shift, flight=True)
            for axis in "xy"
        ),
        Parameter("shift_yaw", 0.0, HEALTHY.yaw_trim, flight=True),
        # Of one flight: rotor speed to body [s].
        Parameter("clock", 0.0, HEALTHY.rotor_speed_time, flight=True, needs=ROTOR_SPEED),
        # Axes of the logged attitude against the body's [rad]; an estimator's may be its sensors'.
        *(
            Parameter(name, 0.0, HEALTHY.tilt, flight=True, needs=AIR)
            for name in ("level_x", "level_y", "heading")
        ),
        # Along z any autopilot calibrates it against gravity at rest.
        *(Parameter(f"bias_{axis}", 0.0, bias, flight=True) for axis in "xy"),
        Parameter("bias_z", 0.0, HEALTHY.accelerometer, flight=True),
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


PASSES = 4  # of noise models
GAUSS_NEWTON_STEPS = 3  # of Gauss-Newton within one
DIFFERENCE_STEP = 1e-4  # of a finite difference, in standard deviations of the prior
LEAST_FLIGHTS = 5  # from which flights are taken as independent clusters; own choice
LARGEST = 2.0  # step in standard deviations of the prior
BOUND = 6.0  # standard deviations of the prior beyond which a parameter does not go


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
        noises = []
        for number, (model, z_alone) in enumerate(zip(models, alone, strict=True)):
            if turn:
                model.smooth(layout.values(z_alone, number))
            # What this flight alone leaves: a disagreement with others is not its noise.
            left = model.residual(layout.values(z_alone, number))
            noises.append(RobustNoise.of(left, model.flight.good, model.flight.step))
        before = z
        z, parts = _descend(models, layout, z, noises)
        alone = [_alone(part, layout, z, number)[0] for number, part in enumerate(parts)]
        if np.abs(z - before).max() < 0.02:
            break
    information = np.sum([part.information for part in parts], axis=0)
    inverse = np.linalg.inv(information + np.eye(layout.size))
    single = parts
    if len(parts) > 1:
        flights = zip(models, alone, noises, strict=True)
        single = [
            _part(model, layout, z_alone, number, noise)
            for number, (model, z_alone, noise) in enumerate(flights)
        ]
    agreement = _agreement(single, layout, alone)
    prior = np.eye(layout.size)
    covariances = clustered_covariances(inverse, prior, [part.scores for part in single])
    # What disagreement adds to the variances of z (k,): between flights, and of what is their own.
    between = np.zeros(layout.size)
    for name, comparison in agreement.items():
        between[layout.names.index(name)] = between_variance(comparison)
    for i in range(len(layout.per_flight) if layout.flights > 1 else 0):
        each = slice(len(layout.shared) + i, None, len(layout.per_flight))
        beyond = np.var(z[each], ddof=1) - np.mean(np.diag(covariances[1])[each])
        between[each] = max(float(beyond), 0.0)
    covariances = [c + np.diag(between) for c in covariances]
    # The gradients of flights at the common estimate hold the differences between them.
    if len(parts) >= LEAST_FLIGHTS:
        covariances.append(sandwich(inverse, prior, np.stack([part.gradient for part in parts])))
    # Whatever flights leave, vehicles lie as the prior says.
    return Estimate(
        layout, z, tuple(map(_not_above_the_prior, covariances)), information, agreement
    )


def _not_above_the_prior(covariance: np.ndarray) -> np.ndarray:
    """Return the covariance (k, k) of z with no deviation above that of the prior, 1."""
    known = np.minimum(1.0 / np.sqrt(np.diag(covariance)), 1.0)
    return covariance * np.outer(known, known)


@dc.dataclass(frozen=True)
class _Part:
    """Share of one flight in the normal equations: gradient (k,), information (k, k) and scores of
    blocks (b, k).
    """

    gradient: np.ndarray
    information: np.ndarray
    scores: np.ndarray


def _descend(
    models: Sequence[FlightModel], layout: Layout, z: np.ndarray, noises: Sequence[RobustNoise]
) -> tuple[np.ndarray, list[_Part]]:
    """Return the minimum of the cost with these noises, and the flights' shares in the equations
    there.

    Without damping at first: coordinates that look the same are told apart by the prior alone, to
    which any damping by the size of their information is large.
    """
    flights = list(enumerate(zip(models, noises, strict=True)))

    def residual(at: np.ndarray) -> np.ndarray:
        parts = (w.whiten(m.residual(layout.values(at, i))).ravel() for i, (m, w) in flights)
        return np.concatenate([*parts, at])

    def shares(at: np.ndarray) -> list[_Part]:
        return [_part(m, layout, at, i, w) for i, (m, w) in flights]

    def normal(at: np.ndarray, r: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        parts = shares(at)
        information = np.sum([p.information for p in parts], axis=0)
        return information + np.eye(layout.size), np.sum([p.gradient for p in parts], axis=0) + at

    bound = np.full(layout.size, BOUND)
    best = minimise(
        residual, normal, z, -bound, bound, GAUSS_NEWTON_STEPS, damping=0.0, longest=LARGEST
    )
    return best.z, shares(best.z)


def _part(
    model: FlightModel, layout: Layout, z: np.ndarray, number: int, noise: RobustNoise
) -> _Part:
    """Return the share of one flight in the normal equations."""
    e = model.residual(layout.values(z, number))
    indices = layout.indices(number)
    columns = np.empty((*e.shape, len(indices)))
    for column, i in enumerate(indices):
        moved = z.copy()
        moved[i] += DIFFERENCE_STEP
        columns[..., column] = (model.residual(layout.values(moved, number)) - e) / DIFFERENCE_STEP
    J = noise.whiten(columns)
    each = np.einsum("mck,mc->mk", J, noise.whiten(e))
    rows = max(1, round(SCORE_BLOCK / model.flight.step))
    blocks = np.add.reduceat(each, np.arange(0, len(each), rows))
    k = layout.size
    information = np.zeros((k, k))
    gradient = np.zeros(k)
    scores = np.zeros((len(blocks), k))
    flat = J.reshape(-1, len(indices))
    information[np.ix_(indices, indices)] = flat.T @ flat
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
        robust = sandwich(inverse, np.eye(len(indices)), part.scores[:, indices], 1.0)
        variance = np.maximum(np.diag(robust), np.diag(inverse))[:n]
        observable = variance < 0.25
        free = variance / np.maximum(1.0 - variance, 1e-9)  # of the prior
        values[number] = np.where(observable, moved[:n] * free / variance, np.nan)
        sds[number] = np.where(observable, np.sqrt(np.maximum(free, 1e-18)), np.nan)
    return {
        p.name: agreement
        for i, p in enumerate(layout.shared)
        if (agreement := compare(values[:, i], sds[:, i])) is not None
    }
