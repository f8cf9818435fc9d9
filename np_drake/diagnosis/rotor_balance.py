"""Balance of the rotors in flights whose inputs were logged too slowly to tell torque.

The mean input of each rotor over a flight still tells what the rotors are asked for. Where one
gives less thrust than before, or the centre of mass has moved, they are asked for a torque that
would turn the sound vehicle: m (3,), in hover thrust of a rotor times arm about roll and pitch, and
in its reaction torque about yaw. Each hypothesis is a linear model of the m of all flights: what
the vehicle has, what has changed in the later flights, and what each flight has of its own, with
Gaussian priors. The variance between flights is not known, so that the evidence is that of
Student's t.
Source: Bayesian linear model with plug-in variances; deviations are those of `estimation.priors`.
"""

import dataclasses as dc
from collections.abc import Mapping, Sequence

import numpy as np
import scipy

from np_drake.diagnosis.options import HALF_WIDTH_95, Options
from np_drake.diagnosis.result import Cause, Estimate, ResidualFinding
from np_drake.effects.base import arm
from np_drake.effects.weak_rotor import WeakRotor
from np_drake.estimation.priors import FREEDOM, HEALTHY
from np_drake.files.number_text import number
from np_drake.flight_log import FlightLog
from np_drake.logs.inputs import hover_exponent
from np_drake.logs.rotors import named_rotors
from np_drake.vehicle import Vehicle

BALANCE_BLOCK = 1.0  # over which inputs are averaged [s]
LEAST_SHARE = 0.1  # of all rotors, below which one does not fly [1]; own choice
LEAST_BALANCE_BLOCKS = 5  # of a flight that tells a balance; own choice
LOSS = 0.2  # deviation of the thrust that a rotor lost [1]; own choice: a cut or chipped blade
# Deviation of torque over thrust of a damaged rotor [1]; source: it goes with the radius.
TORQUE_RATIO = 0.15
NAME = WeakRotor.identifier
ROTOR_NAMES = ("1", "2", "3", "4")
EXPONENT = 0.2  # deviation of the power of input with which thrust goes, over it [1]; own choice


def flight_balance(log: FlightLog, vehicle: Vehicle) -> np.ndarray | None:
    """Return the torque (3,) for which the rotors of a flight are asked, in hover thrust of a rotor
    times arm or torque over thrust [1]; None where it has no `balance`, or is too short.
    """
    if log.balance is None:
        return None
    rows = max(1, round(BALANCE_BLOCK / log.step))
    blocks = len(log) // rows
    shares = np.reshape(log.balance[: blocks * rows], (blocks, rows, 4))
    turning = shares[
        np.all(shares > LEAST_SHARE, axis=(1, 2)) & np.isfinite(shares).all(axis=(1, 2))
    ]
    if len(turning) < LEAST_BALANCE_BLOCKS:
        return None
    return np.median(
        (hover_exponent(vehicle) * np.log(turning).mean(axis=1)) @ torque_map(vehicle).T, axis=0
    )


def torque_map(vehicle: Vehicle) -> np.ndarray:
    """Return the map (3, 4) from relative thrusts to torque, in arms and torque over thrust [1]."""
    unit = np.array([arm(vehicle)] * 2 + [vehicle.torque_coefficient / vehicle.thrust_coefficient])
    return vehicle.mixer[1:] / unit[:, None]


@dc.dataclass(frozen=True)
class Hypothesis:
    """Change of the balance: columns (3, k) of independent unknowns, and their deviations (k,).

    sign: of the first unknown, where it can have one alone.
    """

    columns: np.ndarray
    deviation: np.ndarray
    log_prior: float
    sign: int = 0


@dc.dataclass(frozen=True)
class Weighed:
    """Probability of a hypothesis, and its first unknown with its standard deviation."""

    probability: float
    value: float
    error: float


def hypotheses(vehicle: Vehicle, prior: float) -> dict[str, Hypothesis]:
    """Return what may have changed, by name: nothing, centre of mass, yaw, and a rotor that gives
    less (by its number) or more.

    Args:
        prior: log prior of any change.
    """
    B = torque_map(vehicle)
    axes = np.eye(3)
    level = 4 * axes[:, :2]
    turn = 4 * axes[:, 2:]
    by_name = {
        "nothing": Hypothesis(np.zeros((3, 0)), np.zeros(0), 0.0),
        "centre of mass": Hypothesis(level, np.full(2, HEALTHY.center_of_mass), prior),
        "yaw": Hypothesis(turn, np.full(1, HEALTHY.rotor_gain), prior),
    }
    for name, torque in zip(ROTOR_NAMES, B.T, strict=True):
        both = np.stack([torque, axes[2]], axis=1)
        spread = np.array([LOSS, TORQUE_RATIO])
        log_prior = prior - np.log(len(ROTOR_NAMES))
        by_name[name] = Hypothesis(both, spread, log_prior, sign=1)
        by_name[f"{name} gives more"] = Hypothesis(both, spread, log_prior, sign=-1)
    return by_name


def weigh(
    before: np.ndarray, after: np.ndarray, vehicle: Vehicle, prior: float
) -> dict[str, Weighed]:
    """Return every hypothesis with its probability.

    Args:
        before: (n, 3) balance of flights before what is asked.
        after: (m, 3) of those after.
        prior: log prior of any change.
    """
    B = torque_map(vehicle)
    y = np.concatenate([before, after])
    n = len(y)
    late = np.arange(len(y)) >= len(before)
    squares = np.sum(B**2, axis=1)
    level = np.array([1.0, 1.0, 0.0])
    usual = HEALTHY.rotor_trim**2 * squares + (4 * HEALTHY.center_of_mass_shift) ** 2 * level
    groups = [g for g in (before, after) if len(g)]
    within = sum((np.sum((g - g.mean(axis=0)) ** 2, axis=0) for g in groups), np.zeros(3))
    freedom = FREEDOM + n - len(groups)
    between = (FREEDOM * usual + within) / freedom
    healthy = HEALTHY.rotor_gain**2 * squares + (4 * HEALTHY.center_of_mass) ** 2 * level
    base = np.kron(np.ones((n, n)), np.diag(healthy)) + np.kron(np.eye(n), np.diag(between))
    weighed = {}
    for name, h in hypotheses(vehicle, prior).items():
        X = np.kron(late[:, None], h.columns * h.deviation)
        factor = scipy.linalg.cholesky(base + X @ X.T, lower=True)
        white, columns = (
            scipy.linalg.solve_triangular(factor, v, lower=True) for v in (y.ravel(), X)
        )
        square = float(white @ white)
        size = freedom + y.size
        # Density of Student's t of all balances.
        logdet = np.log(np.diag(factor)).sum()
        evidence = h.log_prior - logdet - 0.5 * size * np.log1p(square / freedom)
        value = 0.0
        error = 0.0
        if len(h.deviation):
            value = float(h.deviation[0] * (columns[:, 0] @ white))
            variance = (1.0 - columns[:, 0] @ columns[:, 0]) * (freedom + square) / size
            error = float(h.deviation[0] * np.sqrt(variance))
        if h.sign:
            evidence += float(np.log(2.0) + scipy.special.log_ndtr(h.sign * value / error))
        weighed[name] = (evidence, value, error)
    probability = scipy.special.softmax([evidence for evidence, _, _ in weighed.values()]).tolist()
    return {
        name: Weighed(p, value, error)
        for p, (name, (_, value, error)) in zip(probability, weighed.items(), strict=True)
    }


FAINT = 0.05  # probability below which a rotor is not mentioned [1]; own choice
SIZES = np.arange(0.02, 0.62, 0.02)  # losses that are tried for the smallest visible one [1]


@dc.dataclass(frozen=True)
class RotorBalance:
    """What the balance of the rotors tells of a change since flights before.

    causes: a rotor that gives less; findings: the same where it is not probable enough. visible: as
        `Diagnosis.visible`.
    """

    causes: tuple[Cause, ...] = ()
    findings: tuple[ResidualFinding, ...] = ()
    visible: Mapping[str, float] = dc.field(default_factory=dict)


def compare_balance(
    before: Sequence[FlightLog], after: Sequence[FlightLog], vehicle: Vehicle, options: Options
) -> RotorBalance:
    """Return what the balance of the rotors tells of a change; nothing where flights lack it.

    Args:
        before: flights before what is asked.
        after: the others.
    """
    balances = [
        [b for log in logs if (b := flight_balance(log, vehicle)) is not None]
        for logs in (before, after)
    ]
    if not all(balances):
        return RotorBalance()
    old, new = (np.array(group) for group in balances)
    prior = options.priors.of_effect(NAME)
    least = options.thresholds.cause_probability
    smallest = _visible(old, new, vehicle, prior, least)
    visible = {f"{NAME}.efficiency": smallest} if np.isfinite(smallest) else {}
    weighed = weigh(old, new, vehicle, prior)
    rotor = max(ROTOR_NAMES, key=lambda name: weighed[name].probability)
    best = weighed[rotor]
    named = named_rotors([*before, *after], vehicle)[int(rotor) - 1]
    half = HALF_WIDTH_95 * float(np.hypot(best.error, EXPONENT * best.value))
    value, low, high = np.exp([-best.value, -best.value - half, -best.value + half]).tolist()
    if best.value <= 0 or best.probability < FAINT:
        return RotorBalance(visible=visible)
    if best.probability < least:
        text = f"the balance of the rotors fits {named} at {number(value, 2)} of its thrust"
        return RotorBalance(
            (), (ResidualFinding(NAME, text, 0.0, {"probability": best.probability}),), visible
        )
    effect = WeakRotor(float(rotor), value)
    parameters = {
        "rotor": Estimate(effect.rotor, "", (effect.rotor, effect.rotor)),
        "efficiency": Estimate(value, "1", (low, high)),
    }
    cause = Cause(
        NAME,
        best.probability,
        parameters,
        dict[str, float | None]((log.name, None) for log in after),
        effect=effect,
        changed=True,
        rotor=named,
    )
    return RotorBalance((cause,), (), visible)


def _visible(
    before: np.ndarray, after: np.ndarray, vehicle: Vehicle, prior: float, least: float
) -> float:
    """Return the smallest loss of the rotor that shows it least that would be named [1]; NaN: none.

    It is put on flights that are otherwise as those before.
    """
    sound = after - after.mean(axis=0) + before.mean(axis=0)
    seen = []
    for rotor in ROTOR_NAMES:
        pattern = torque_map(vehicle)[:, int(rotor) - 1]
        named = (
            size
            for size in SIZES
            if weigh(before, sound + size * pattern, vehicle, prior)[rotor].probability >= least
        )
        seen.append(1.0 - np.exp(-next(named, np.nan)))
    return float(np.max(seen))
