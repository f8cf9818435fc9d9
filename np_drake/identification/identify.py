"""Identification of a vehicle from its flight logs."""

import dataclasses as dc
import itertools
from collections.abc import Sequence
from functools import cached_property

import numpy as np
import scipy

from np_drake.estimation.noise import RobustNoise
from np_drake.flight_log import FlightLog
from np_drake.identification.estimation import (
    DIFFERENCE_STEP,
    Estimate,
    Layout,
    estimate,
    parameters,
)
from np_drake.identification.model import TORQUE, FlightModel, Frame
from np_drake.identification.quantities import (
    OBSERVABLE_RATIO,
    QUANTITIES,
    ROTOR_GAINS,
    Z_975,
    Basis,
    Identified,
    Quantity,
)
from np_drake.identification.rate_loop import AxisLoop, identify_rate_loop
from np_drake.identification.signals import G, Signals, common_drive, signals
from np_drake.vehicle import Vehicle
from np_drake.vehicle.published import published_priors
from np_drake.vehicle.rotor_layout import RotorName, rotor_names
from np_drake.vehicle.vehicle import AIR

SHORTEST = 3.0  # flight that tells anything [s]; own choice: three swings of a small vehicle
LEAST_COUNTING = 1.5  # of it that counts [s]; own choice: half of that
REMEDY = "Fly roll and pitch doublets, fast turns of the heading and quick changes of height."
FULL = 0.95  # throttle of hover from which no vehicle flies, so that it is in another unit [1]
THRUST_NUMBERS = (0.05, 0.16)  # C_T of propellers that are made [1]; source: published static tests
UNUSUAL = 2.5  # deviations of published vehicles from which an inertia is doubted [1]; own choice
LEAST_HOVER = 0.05  # throttle in hover [1]; source: `vehicle new`
RANK = 1e-6  # of a covariance: gains of rotors have a fixed mean [1]
SHARED = 0.5  # share of a variance that another has, from which both trade [1]; own choice
TINY = 1e-12  # power of a channel that holds nothing [1]
TRADE = 0.9  # correlation from which two quantities trade against each other [1]; own choice
C_T = (
    "C_T = thrust / (rho n² D⁴)",
    "Check mass and propeller, and the pole pairs of the log: 12 or 14 poles?",
)
OVER_UNIT = ("its share of m l²", "Check the wheelbase and the places of the rotors.")
STRENGTH = ("thrust over that of hover at this throttle", "Check unit and ends of the throttle.")


@dc.dataclass(frozen=True)
class Identification:
    """Vehicle as its flights tell it.

    basis: what turns parameters into those of the vehicle.
    estimate: joint posterior.
    parts: what the logs hold. models: of the flights.
    prior: vehicle whose geometry was given.
    notes: what was left out.
    """

    basis: Basis
    estimate: Estimate
    parts: frozenset[str]
    models: tuple[FlightModel, ...]
    prior: Vehicle
    notes: tuple[str, ...]
    # Of an autopilot; empty: logs hold no commanded rates, or show no loop.
    rate_loop: tuple[AxisLoop, ...]
    rotors: tuple[RotorName, ...]  # what they are called
    # By axis, how much torque over the true one the logged inputs may hold as noise [1].
    input_noise: np.ndarray

    @cached_property
    def quantities(self) -> tuple[Identified, ...]:
        """What is told of the vehicle, in the order of a vehicle file."""
        e = self.estimate
        layout = e.layout
        quantities = []
        for q in QUANTITIES:
            if not self.parts.issuperset(q.needs):
                continue
            here, gradient = self.of(q, e.z)
            before, slope = self.of(q, np.zeros_like(e.z))
            sd = float(np.sqrt(e.variance(gradient)))
            prior = float(np.linalg.norm(_of_one_flight(slope, layout)))
            if q.field == "inertia" and q.positive:
                excess = float(self.input_noise[q.index[0]])
                here, sd = _without_attenuation((here, sd), (before, prior), excess)
            wide = Z_975 * sd
            known = Z_975 * prior
            bounds = np.array([here, here - wide, here + wide, before - known, before + known])
            value, low, high, *both = (np.exp(bounds) if q.positive else bounds).tolist()
            observable = bool(0.0 < sd < OBSERVABLE_RATIO * prior)
            steepest = int(np.argmax(np.abs(_of_one_flight(gradient, layout))))
            follows = layout.names[steepest] if steepest < len(layout.shared) else ""
            p = e.agreement[follows].p if follows in e.agreement else float("nan")
            rotor = self.rotors[q.index[0]] if q.field == ROTOR_GAINS else None
            quantities.append(
                Identified(q, value, low, high, (both[0], both[1]), observable, p, follows, rotor)
            )
        return tuple(quantities)

    def of(self, q: Quantity, z: np.ndarray) -> tuple[float, np.ndarray]:
        """Return a quantity, the logarithm of a positive one, and its derivatives by z (k,)."""

        def value(z: np.ndarray) -> float:
            number = q.of(self.estimate.layout.values(z), self.basis)
            return float(np.log(number)) if q.positive else number

        return value(z), scipy.optimize.approx_fprime(z, value, DIFFERENCE_STEP)

    def __getitem__(self, name: str) -> Identified:
        """Return what is told of a quantity by its name."""
        return next(q for q in self.quantities if q.name == name)


def identify(
    flights: Sequence[FlightLog],
    prior: Vehicle,
    *,
    mass: float | None = None,
    trusted: bool = False,
    drive: str = "",
    stop: float = 1.0,
) -> Identification:
    """Return what flights tell of a vehicle.

    Args:
        flights: of one vehicle, with the same input.
        prior: vehicle whose rotor positions, directions and radius are given.
        mass: with battery [kg]; None: not known.
        trusted: whether logged thrust [N], or the prior's thrust coefficient, is right, so that the
            mass is told.
        drive: what turns the rotors, of `signals.DRIVES`; empty: the first that all logs hold.
        stop: share of each flight that is used, from its beginning [1].
    Raises: ValueError: one line, where flights tell nothing of the vehicle or differ in what they
        hold.
    """
    drive = common_drive(flights, drive)
    logs, readings, notes = _usable(flights, prior, drive, stop)
    parts = _parts(readings, drive)
    frame = _frame(readings, prior, drive)
    basis = _basis(frame, prior, drive, mass, trusted=trusted)
    known = parts | ({"mass"} if basis.coefficient is None and not basis.newtons else {"trusted"})
    known |= {"full"} if frame.throttle < FULL else set()
    step = max(log.step for log in logs)
    layout = Layout.of(parameters(basis.spin, step, parts), parts, len(logs))
    models = tuple(FlightModel(flight, frame) for flight in readings)
    loops = identify_rate_loop(logs) or ()
    if not loops and all(log.commanded_rates is not None for log in logs):
        notes.append(
            "rate loop: no body rate follows its command as a loop would, or flights are "
            "short; none is told"
        )
    fitted = estimate(models, layout)
    motors = [log.motors for log in logs if log.layout is None]
    rotors = tuple(rotor_names(prior.rotor_positions, motors))
    # A collective throttle tells no torque.
    noise = np.zeros(3) if drive == "collective" else input_noise(models, fitted)
    return Identification(
        basis, fitted, frozenset(known), models, prior, tuple(notes), loops, rotors, noise
    )


def _usable(
    logs: Sequence[FlightLog], prior: Vehicle, drive: str, stop: float
) -> tuple[list[FlightLog], list[Signals], list[str]]:
    """Return the logs that tell something of the vehicle, their signals, and a line on each that is
    left out.

    Raises: ValueError: where none does.
    """
    long = [log for log in logs if lasts(log) >= SHORTEST]
    short = (log.name for log in logs if lasts(log) < SHORTEST)
    notes = [f"{name}: shorter than {SHORTEST:g} s; left out" for name in short]
    if not long:
        most = max(map(lasts, logs), default=0.0)
        raise ValueError(
            f"identify: needs a flight of {SHORTEST:g} s at least; the longest lasts {most:.2g} s."
        )
    usable = []
    readings = []
    for log in long:
        flight = signals(log, prior.unmixer, drive).part(0.0, stop)
        if reason := unfit(flight, stop):
            notes.append(f"{log.name}: {reason}; left out")
        else:
            usable.append(log)
            readings.append(flight)
    if not usable:
        raise ValueError(
            f"identify: no flight tells anything of the vehicle. {'; '.join(notes)}. {REMEDY}"
        )
    if any(flight.command is None for flight in readings):
        readings = [dc.replace(flight, command=None) for flight in readings]
    return usable, readings, notes


def _basis(frame: Frame, prior: Vehicle, drive: str, mass: float | None, *, trusted: bool) -> Basis:
    """Return what turns quantities over mass into those of the vehicle."""
    mass_from_thrust = trusted and mass is None
    measured = drive == "rotor_speed"
    coefficient = prior.thrust_coefficient if mass_from_thrust and measured else None
    spin = frame.unit
    if not measured:
        spin = float(np.sqrt(0.25 * (mass or prior.mass) * G / prior.thrust_coefficient))
    newtons = mass_from_thrust and drive == "command"
    return Basis(frame, drive, mass, coefficient, spin, newtons)


def trades(identification: Identification) -> list[tuple[list[str], list[str]]]:
    """Return names of quantities that trade against each other: of two fields of a vehicle file,
    one of which is not told, a sum is told far better than either.
    """
    kept = [q for q in identification.quantities if q.quantity.field]
    fields = np.array([q.quantity.field for q in kept])
    gradients = np.stack(
        [identification.of(q.quantity, identification.estimate.z)[1] for q in kept]
    )
    covariance = gradients @ identification.estimate.covariances[0] @ gradients.T
    deviation = np.sqrt(np.diag(covariance))
    correlation = covariance / np.outer(deviation, deviation)

    def shared(field: str, other: str) -> tuple[list[Identified], float]:
        """Return the quantities of a field most of whose variance another has, and its largest
        share.
        """
        across = correlation[np.ix_(fields == field, fields == other)]
        among = np.linalg.pinv(correlation[np.ix_(fields == other, fields == other)], RANK)
        share = np.diag(across @ among @ across.T)
        places = np.flatnonzero(fields == field)[share > SHARED]
        return [kept[i] for i in places], float(share.max())

    pairs = []
    for field, other in itertools.combinations(dict.fromkeys(fields), 2):
        one, most = shared(field, other)
        two, more = shared(other, field)
        trading = one and two and max(most, more) > TRADE**2
        if trading and not all(q.observable for q in (*one, *two)):
            pairs.append(([q.name for q in one], [q.name for q in two]))
    return pairs


def doubts(identification: Identification) -> list[str]:
    """Return what physics doubts of the values that flights tell, a sentence each."""
    basis = identification.basis
    frame = basis.frame
    weight = basis.mass_of(identification.estimate.layout.values(identification.estimate.z)) * G
    unit = weight / G * frame.arm**2
    inertias = published_priors().inertia.within(UNUSUAL)
    per_coefficient = (2 * np.pi) ** 2 / (AIR * (2 * frame.radius) ** 4)
    # Factor of the quantity, bounds, what they are of, remedy.
    inertia = (1.0 / unit, inertias, *OVER_UNIT)
    thrust = (4.0 / weight, _strengths(identification), *STRENGTH)
    checks = {
        "thrust coefficient": (per_coefficient, THRUST_NUMBERS, *C_T),
        "inertia xx": inertia,
        "inertia yy": inertia,
        "thrust at full throttle": thrust,
        "thrust at full command": thrust,
    }
    sentences = []
    for q in identification.quantities:
        if basis.ratios or not q.observable or q.name not in checks:
            continue
        factor, (least, most), what, remedy = checks[q.name]
        if q.high * factor < least or q.low * factor > most:
            bounds = f"{least:.2g} to {most:.2g}; got {factor * q.value:.2g}"
            sentences.append(f"{q.name}: {what} is usually {bounds}. {remedy}")
    return sentences


def _strengths(identification: Identification) -> tuple[float, float]:
    """Return thrust at full throttle over that in hover, of a curve between line and square [1]."""
    hover = max(identification.basis.frame.throttle, LEAST_HOVER)
    named = ("command without thrust", "idle speed over full speed")
    begins = max((q.value for q in identification.quantities if q.name in named), default=0.0)
    turning = max((hover - max(begins, 0.0)) / (1.0 - begins), LEAST_HOVER)
    return 1.0 / hover, 1.0 / turning**2


def input_noise(models: Sequence[FlightModel], estimate: Estimate) -> np.ndarray:
    """Return the largest power (3,) of noise in the logged torque about each axis, over that of the
    true torque [1].

    Where a log has other samples than the controller answered to, or a tachometer's, noise of the
    input leaves a residual beyond the gyro's own, and draws the answer of the motion to zero: the
    inertia is too large by as much at most. All of that residual may be a disturbance, too.
    Source: Frisch 1934 (bounds of a regression with errors in both variables).
    """
    missed, gyro, predicted = np.zeros((3, 3))
    for number, model in enumerate(models):
        flight = model.flight
        e = model.residual(estimate.layout.values(estimate.z, number))
        noise = RobustNoise.of(e, flight.good, flight.step)
        smooth = np.diff(flight.smooth[flight.edges], axis=0) / np.diff(flight.instants)[:, None]
        parts = np.zeros((*e.shape, 3))
        parts[:, TORQUE, 0] = e[:, TORQUE]
        parts[:, TORQUE, 1] = flight.alpha - smooth
        parts[:, TORQUE, 2] = flight.alpha - e[:, TORQUE]
        power = np.sum(noise.whiten(parts)[:, TORQUE] ** 2, axis=0)
        missed += power[:, 0]
        gyro += power[:, 1]
        predicted += power[:, 2]
    return np.maximum(missed - gyro, 0.0) / np.maximum(predicted, TINY)


def _without_attenuation(
    estimate: tuple[float, float], prior: tuple[float, float], excess: float
) -> tuple[float, float]:
    """Return the logarithm of an inertia and its deviation, where noise of the input may have made
    it larger by any part of the share `excess`.

    Args:
        estimate: logarithm and deviation as if there were none.
        prior: the same before any flight.
        excess: largest share by which it is too large [1].
    """
    (value, sd), (guess, wide) = estimate, prior
    known = wide**-2.0
    told = max(sd**-2.0 - known, 0.0)  # by the flights alone
    if told == 0.0:
        return value, sd
    alone = (value * sd**-2.0 - guess * known) / told
    span = np.log1p(excess)
    # A uniform variate in the span.
    told = 1.0 / (1.0 / told + span**2 / 12.0)
    precision = told + known
    return (told * (alone - 0.5 * span) + known * guess) / precision, precision**-0.5


def lasts(log: FlightLog) -> float:
    """Return the length of a flight [s]."""
    return float(log.t[-1] - log.t[0]) if len(log) > 1 else 0.0


def unfit(flight: Signals, share: float = 1.0) -> str:
    """Return why a flight tells nothing of its vehicle; empty: it does.

    Args:
        flight: its signals.
        share: of the flight that counts [1].
    """
    if not np.isfinite(flight.input).all():
        return "what turns the rotors is not known in every row"
    seconds = float(flight.good.sum() * flight.step)
    if seconds < LEAST_COUNTING * share:
        return f"flies {seconds:.1f} s without gaps and faults"
    turns = flight.input[flight.edges[:-1]][flight.good].mean(axis=0) > 0
    return "" if turns.all() else "a rotor does not turn, as on a desk"


def _of_one_flight(gradient: np.ndarray, layout: Layout) -> np.ndarray:
    """Return derivatives by the shared parameters, and by a flight's own where those of all flights
    move together.
    """
    per_flight = gradient[len(layout.shared) :].reshape(layout.flights, len(layout.per_flight))
    return np.concatenate([gradient[: len(layout.shared)], per_flight.sum(axis=0)])


def _parts(flights: Sequence[Signals], drive: str) -> set[str]:
    """Return what the logs hold."""
    throttle = drive == "throttle" or all(s.command is not None for s in flights)
    present = {
        "speed": drive == "rotor_speed",
        "motors": drive != "rotor_speed" or throttle,
        "newtons": drive == "command",
        "throttle": throttle,
        "collective": drive == "collective",
        "rotors": drive != "collective",
        "voltage": (throttle or drive == "collective")
        and all(s.voltage is not None for s in flights),
        "velocity": any(s.velocity is not None for s in flights),
        "accelerometer": all(s.accelerometer for s in flights),
    }
    return {name for name, there in present.items() if there}


def _frame(flights: Sequence[Signals], prior: Vehicle, drive: str) -> Frame:
    """Return what is given of the vehicle, with the input that would carry it on average."""
    force = np.concatenate([np.linalg.norm(s.force[s.good], axis=1) for s in flights])
    level = float(np.mean(force)) / G
    inputs = np.concatenate([s.input[s.edges[:-1]][s.good] for s in flights])
    if drive == "rotor_speed":
        unit = float(np.sqrt(np.mean(inputs**2) / level))
    else:
        unit = float(np.mean(inputs) / level if drive == "command" else np.median(inputs))
    throttle = unit if drive in ("throttle", "collective") else 0.0
    commands = [s.command[s.edges[:-1]][s.good] for s in flights if s.command is not None]
    if commands:
        throttle = float(np.median(np.concatenate(commands)))
    volts = [np.median(s.voltage) for s in flights if s.voltage is not None]
    return Frame(
        prior.rotor_positions_B,
        np.array(prior.rotor_directions, float),
        prior.rotor_radius,
        unit,
        float(np.median(volts)) if volts else None,
        throttle,
    )
