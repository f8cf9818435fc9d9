"""Study `identification`: random vehicles flown in Drake, with logs as real sensors write them,
identified, beside the truth and the prior.
"""

import dataclasses as dc
import time
from collections.abc import Sequence
from functools import partial, reduce
from typing import Annotated, Any

import numpy as np
import pandas as pd
from typer import Option

from diagrams.batch.run import Case, FailedRun, Report, Run, failures, results
from diagrams.evidence.challenge.flight import Simulation, fly
from diagrams.evidence.challenge.plans import draw_plans
from diagrams.evidence.challenge.sensors import (
    REAL,
    draw_sensor_quality,
    kept_rows,
    with_sensor_noise,
)
from diagrams.evidence.studies.options import Column, fixed, percent, tabulate
from np_drake import attitude
from np_drake.effects import BladeFlapping, LinearDrag, TranslationalLift
from np_drake.effects.base import Effect
from np_drake.effects.calibration import effects_of
from np_drake.effects.pendulum import hook_velocity
from np_drake.files.number_text import NOTHING
from np_drake.flight_log import FlightLog
from np_drake.identification.identify import identify
from np_drake.identification.quantities import Identified, Quantity
from np_drake.identification.signals import G, force_between
from np_drake.references.base import Paced
from np_drake.vehicle.published import LogNormal, published_priors
from np_drake.vehicle.vehicle import (
    AIR,
    Calibration,
    MeasurementNoise,
    ThrottleMap,
    Vehicle,
    least_torque_over_thrust,
)

INPUTS = ("rotor_speed", "throttle", "command")
# [kg]
LIGHTEST = 0.03
HEAVIEST = 20.0
# white noise of rotor speed, of hover [1]; that of telemetry of the flights by IMRCLab is 0.001
TACHOMETER = 0.002
# share of rotor commands at a limit, from which a loop oscillates [1]; own choice
SATURATED = 0.005
ATTEMPTS = 40  # draws of a vehicle until its controller flies it
ALIKE = {  # quantities of one kind, by the line that holds them
    "inertia xx, yy": ("inertia xx", "inertia yy"),
    "inertia xz, yz": ("inertia xz", "inertia yz"),
    "centre of mass x, y": ("centre of mass x", "centre of mass y"),
    "gains of the rotors": tuple(f"gain of rotor {i}" for i in (1, 2, 3, 4)),
    "IMU x, y, z": ("IMU x", "IMU y", "IMU z"),
    "IMU tilt x, y": ("IMU tilt x", "IMU tilt y"),
    "time constants up, down": ("time constant up", "time constant down"),
}
LINE_OF = {name: line for line, names in ALIKE.items() for name in names}
ERRORS = {"error": "error", "prior_error": "prior alone"}  # with their headings
Line = dict[str, Any]


@dc.dataclass(frozen=True)
class Truth:
    """A simulated vehicle.

    vehicle: its true parameters, calibration included.
    throttle: its map.
    imu: (3,) the accelerometer from Bo [m]. drag, flapping, lift: of the air.
    input: what its logs hold. known: what its owner knows: geometry and mass, with guesses for the
        rest. cells: of its battery, over the usual number [1]. changes: effects that act on it too.
    """

    vehicle: Vehicle
    throttle: ThrottleMap
    imu: np.ndarray
    drag: LinearDrag
    flapping: BladeFlapping
    lift: TranslationalLift
    input: str
    known: Vehicle
    cells: float = 1.0
    changes: tuple[Effect, ...] = ()

    def value_of(self, quantity: Quantity, volts: float | None = None) -> float | None:
        """Return the true value of a quantity; None where it stands for none of the vehicle's.

        Args:
            volts: voltage to which full throttle refers [V]; None: that of the vehicle.
        """
        v = self.vehicle
        composed = {
            "logged thrust, true over logged": 1.0,
            "torque over thrust": v.torque_coefficient / v.thrust_coefficient,
            "time constant down": v.rotor_time_constant,
            "thrust at full throttle": float(self.throttle.thrust(1.0, volts)),
            "drag, lateral": self.drag.d_x / v.mass,
            "drag, vertical": self.drag.d_z / v.mass,
            "lift of lateral speed": self.lift.lift / v.mass,
        }
        if quantity.name in composed or not quantity.field:
            return composed.get(quantity.name)
        value = reduce(getattr, quantity.field.split("."), v)
        return float(np.array(value)[quantity.index])


def draw_truth(rng: np.random.Generator, kind: str) -> Truth:
    """Draw a vehicle, with the mean and deviation of published ones.

    Args:
        kind: of input, one of `INPUTS`.
    """

    def spread(mean: float, sd: float) -> float:  # uniform
        return float(mean + np.sqrt(3.0) * sd * rng.uniform(-1.0, 1.0))

    def drawn(of: LogNormal) -> float:  # uniform in the logarithm
        return float(np.exp(spread(of.mean, of.deviation)))

    mass = float(np.exp(rng.uniform(np.log(LIGHTEST), np.log(HEAVIEST))))
    arm = rng.uniform(0.13, 0.2) * mass ** (1 / 3)
    angle = rng.uniform(0.65, 0.92)
    x = arm * np.sin(angle)
    y = arm * np.cos(angle)
    radius = rng.uniform(0.4, 0.65) * arm
    number = rng.uniform(0.06, 0.18)
    k = float(number * AIR * (2 * radius) ** 4 / (2 * np.pi) ** 2)
    lever = least_torque_over_thrust(number, 2 * radius) / rng.uniform(0.4, 0.7)
    priors = published_priors()
    xx = mass * arm**2 * drawn(priors.inertia)
    yy = xx * drawn(priors.inertia_pitch)
    J = np.diag([xx, yy, (xx + yy) * min(drawn(priors.inertia_yaw), 0.98)])
    for i, j in ((0, 1), (0, 2), (1, 2)):
        J[i, j] = J[j, i] = -0.5 * (xx + yy) * spread(0.0, 0.02)
    gains = 1.0 + np.array([spread(0.0, 0.02) for _ in range(4)])
    calibration = Calibration(
        center_of_mass=[spread(0.0, sd) * arm for sd in (0.03, 0.03, 0.05)],
        rotor_gains=[float(g) for g in gains / gains.mean()],
        command_delay=rng.uniform(0.0, 0.015),
        rotor_inertia=float(mass * arm**2 * min(drawn(priors.rotor_inertia), 2e-3)),
        imu_position=[spread(0.0, 0.1) * arm for _ in range(3)],
        imu_tilt=[spread(0.0, 0.015) for _ in range(3)],
    )
    strongest = rng.uniform(1.9, 3.5) * 0.25 * mass * G
    throttle = ThrottleMap(strongest, rng.uniform(0.0, 0.4), 0.0, 3.7, rng.uniform(1.0, 2.0))
    lag = float(np.clip(drawn(priors.time_constant), 0.012, 0.07))
    turns = 1.0 if rng.integers(2) else -1.0
    vehicle = Vehicle(
        name="simulated",
        mass=mass,
        inertia=J.tolist(),
        rotor_positions=[[x, y, 0.0], [x, -y, 0.0], [-x, -y, 0.0], [-x, y, 0.0]],
        rotor_directions=[turns, -turns, turns, -turns],
        thrust_coefficient=k,
        torque_coefficient=float(lever * k),
        rotor_radius=radius,
        max_rotor_thrust=strongest,
        rotor_time_constant=lag,
        throttle=throttle,
        calibration=calibration,
        command_timing="held",
        measurement_noise=MeasurementNoise(),
    ).check()
    known = dc.replace(
        vehicle,
        inertia=np.diag(mass * arm**2 * np.array([0.3, 0.3, 0.5])).tolist(),
        rotor_time_constant=0.0,
        calibration=Calibration(),
        throttle=None,
        thrust_coefficient=1.4 * k,
        torque_coefficient=1.4 * float(lever * k),
    ).check()
    drag = mass * rng.uniform(0.05, 0.3)
    return Truth(
        vehicle=vehicle,
        throttle=throttle,
        imu=np.array(calibration.imu_position),
        drag=LinearDrag(drag, drag, mass * rng.uniform(0.05, 0.3)),
        flapping=BladeFlapping(mass * arm * rng.uniform(0.0, 0.15)),
        lift=TranslationalLift(mass * rng.uniform(0.0, 0.03)),
        input=kind,
        known=known,
    )


def fly_truth(
    truth: Truth, rng: np.random.Generator, flights: int, seconds: float, pace: float = 1.0
) -> list[FlightLog]:
    """Return logs of ordinary flights, of `seconds` [s] each, at a pace over that drawn [1]."""
    v = truth.vehicle
    spin = float(np.sqrt(0.25 * v.mass * G / v.thrust_coefficient))
    calibration = dc.replace(v.calibration, imu_tilt=[0.0, 0.0, 0.0], clock_offset=0.0)
    air = (truth.drag, truth.flapping, truth.lift)
    acting = (*effects_of(calibration, v), *air, *truth.changes)
    seen = np.array([0.002] * 3 + [0.0, *[0.003] * 3] + [0.02] * 3 + [v.measurement_noise.rate] * 3)
    logs = []
    for number, plan in enumerate(draw_plans(rng, v, seconds, flights)):
        # The accelerometer's reading is turned to W by the attitude of the log.
        quality = draw_sensor_quality(REAL, rng, spin)
        quality = dc.replace(quality, rotor=TACHOMETER * spin, turned=True)
        plan = dc.replace(plan, reference=Paced(plan.reference, pace))
        t = quality.instants(rng, seconds)
        exact = fly(v, plan, acting, t=t, simulation=Simulation(noise=seen))
        thrust = exact.u @ v.unmixer.T
        limited = (thrust < 0.01 * v.max_rotor_thrust) | (thrust > 0.99 * v.max_rotor_thrust)
        if np.mean(limited) > SATURATED:
            raise FailedRun(
                "identification: no ordinary flight: the loop of this vehicle oscillates."
            )
        logs.append(_as_logged(exact, truth, quality, rng, f"flight{number}"))
    return logs


def draw_and_fly(
    seed: int, kind: str, flights: int, seconds: float, pace: float = 1.0
) -> tuple[Truth, list[FlightLog], int]:
    """Return a vehicle and its logs, drawn until its controller flies it without oscillation, and
    how many draws it did not.

    Raises: FailedRun: if no draw can be flown.
    """
    for attempt in range(ATTEMPTS):
        rng = np.random.default_rng((seed, attempt))
        truth = draw_truth(rng, kind)
        try:
            return truth, fly_truth(truth, rng, flights, seconds, pace), attempt
        except FailedRun:
            continue
    raise FailedRun(f"identification: no vehicle of seed {seed} could be flown.")


def _as_logged(
    exact: FlightLog, truth: Truth, quality, rng: np.random.Generator, name: str
) -> FlightLog:
    """Return a flight as the sensors of the vehicle log it."""
    v = truth.vehicle
    g = np.array([0.0, 0.0, G])
    # The accelerometer averages over the interval after a row: the change of its velocity.
    force = force_between(exact.t, exact.q, hook_velocity(truth.imu, exact.x))
    force = np.concatenate([force, force[-1:]])
    moved = dc.replace(exact, a=attitude.rotate(exact.q, force) - g)
    log = with_sensor_noise(moved, v, quality, rng)
    turn = attitude.from_rotation_vector(np.array([v.calibration.imu_tilt]))[0]
    turns = np.broadcast_to(turn, log.q.shape)
    force = attitude.rotate_back(turns, attitude.rotate_back(log.q, log.a + g))
    # An autopilot estimates its attitude by the same IMU; that of a research vehicle is by markers.
    q = attitude.multiply(log.q, turns) if truth.input == "throttle" else log.q
    w = attitude.rotate_back(turns, log.w)
    log = dc.replace(log, q=q, a=attitude.rotate(q, force) - g, w=w, al=None, name=name)
    log = log.taken(kept_rows(rng, quality, len(log)))
    if truth.input == "rotor_speed":
        return dc.replace(log, input="rotor_speed")
    if truth.input == "command":
        return dc.replace(log, rotor=None)
    sagging = truth.cells * (np.linspace(4.0, 3.5, len(log)) + 0.02 * rng.normal())
    throttle = truth.throttle.throttle(np.maximum(log.u @ v.unmixer.T, 0.0), sagging[:, None])
    return dc.replace(log, rotor=None, throttle=throttle, voltage=sagging, input="normalised")


def identified(case: Case, *, flights: int, seconds: float, pace: float, every: int) -> Line:
    """Draw the vehicle of a case {"seed", "kind"}, fly it so often and long [s], identify it from
    every n-th row, and return what is identified, and processor time of the identification alone
    [s].

    Raises: FailedRun: if no vehicle of this seed can be flown.
    """
    truth, logs, refused = draw_and_fly(case["seed"], case["kind"], flights, seconds, pace)
    logs = [log.taken(slice(None, None, every)) for log in logs]
    start = time.process_time()
    identification = identify(logs, truth.known, mass=truth.vehicle.mass)
    quantities = identification.quantities
    spent = time.process_time() - start
    volts = identification.basis.frame.volts
    true = [truth.value_of(q.quantity, volts) for q in quantities]
    return {
        "mass": truth.vehicle.mass,
        "refused": refused,
        "processor_time": spent,
        "quantities": [
            _against_truth(q, value, truth)
            for q, value in zip(quantities, true, strict=True)
            if value is not None
        ],
    }


def _against_truth(q: Identified, true: float, truth: Truth) -> Line:
    low, high = q.prior
    quantity = q.quantity
    guess = float(np.sqrt(low * high)) if quantity.positive else 0.5 * (low + high)
    unit, error = error_of(quantity, q.value, true, truth)
    return {
        "name": q.name,
        "air": "velocity" in quantity.needs,
        "unit": unit,
        "told": q.observable,
        "within": bool(q.low <= true <= q.high),
        "value": q.value,
        "ci95": [q.low, q.high],
        "true": true,
        "error": error,
        "prior_error": error_of(quantity, guess, true, truth)[1],
    }


def error_of(quantity: Quantity, value: float, true: float, truth: Truth) -> tuple[str, float]:
    """Return the unit in which a quantity is judged, and the error.

    A share of the truth where the quantity is positive, of the inertia it belongs to where it is a
    product of inertia.
    """
    off = abs(value - true)
    if quantity.unit == "s":
        return "ms", 1e3 * off
    if quantity.positive and value > 0.0:
        return "%", 100.0 * abs(float(np.log(value / true)))
    if quantity.unit == "kg·m²":
        return "%", 100.0 * off / float(np.mean(np.diag(truth.vehicle.J)[:2]))
    if quantity.unit == "m":
        arms = np.linalg.norm(truth.vehicle.rotor_positions_B[:, :2], axis=1)
        return "mm per 10 cm arm", 100.0 * off / float(arms.mean())
    return "own unit", off


def quantity_lines(results: Sequence[Line]) -> list[Line]:
    """Return a line for every kind of quantity: how often told, share of intervals with the truth,
    median errors over the vehicles of which it is told.
    """
    frame = pd.DataFrame([q for result in results for q in result["quantities"]])
    lines = []
    for name, alike in frame.groupby(frame["name"].replace(LINE_OF), sort=False):
        observable = alike[alike["told"]]
        lines.append(
            {
                "name": name,
                "unit": alike["unit"].iloc[0],
                "air": bool(alike["air"].iloc[0]),
                "count": len(alike),
                "told": len(observable),
                "within": float(observable["within"].mean()) if len(observable) else None,
                **{k: float(observable[k].median()) if len(observable) else None for k in ERRORS},
            }
        )
    return lines


def pooled_lines(results: Sequence[Line]) -> list[Line]:
    """Return a line for all vehicles and for those of each input: shares of intervals with the
    truth, and cost.
    """
    lines = []
    for kind in ("all", *INPUTS):
        of_kind = [r for r in results if kind in ("all", r["kind"])]
        if not of_kind:
            continue
        refused = sum(r["refused"] for r in of_kind)
        line = {"input": kind, "vehicles": len(of_kind), "refused": refused}
        for air, key in ((False, "vehicle"), (True, "air")):
            line[key], line[f"{key}_ci95"], line[f"{key}_told"] = _covered(of_kind, air)
        times = [r["processor_time"] for r in of_kind]
        lines.append(line | {"processor_time": float(np.median(times))})
    return lines


def _covered(results: Sequence[Line], air: bool) -> tuple[float | None, float | None, int]:
    """Return the share of intervals with the truth, half its 95 % interval by vehicles, and the
    number of intervals.
    """
    counts = [
        [q["within"] for q in r["quantities"] if q["told"] and q["air"] == air] for r in results
    ]
    inside, intervals = np.array([(sum(c), len(c)) for c in counts], float).T
    total = int(intervals.sum())
    n = len(results)
    if not total:
        return None, None, 0
    share = float(inside.sum() / total)
    # Intervals of one vehicle err together: variance of a ratio of sums over vehicles.
    variance = n / max(n - 1, 1) * np.sum((inside - share * intervals) ** 2)
    return share, 1.96 * float(np.sqrt(variance) / total) if n > 1 else None, total


def _share(line: Line, key: str) -> str:
    half = line[f"{key}_ci95"]
    spread = "" if half is None else f" ± {100 * half:.1f}"
    share = NOTHING if line[key] is None else f"{100 * line[key]:.1f}{spread} %"
    return f"{share} of {line[f'{key}_told']}"


def _error(line: Line, key: str) -> str:
    return NOTHING if line[key] is None else f"{line[key]:.2g}"


POOLED: tuple[Column, ...] = (
    ("input", "input"),
    ("vehicles", "vehicles"),
    ("vehicle file", partial(_share, key="vehicle")),
    ("drag and lift", partial(_share, key="air")),
    ("draws not flyable", "refused"),
    ("processor time [s]", fixed("processor_time", 1)),
)
QUANTITY: tuple[Column, ...] = (
    ("quantity", "name"),
    ("told", lambda line: f"{line['told']} of {line['count']}"),
    ("inside", percent("within", 1)),
    *((heading, partial(_error, key=key)) for key, heading in ERRORS.items()),
    ("unit", "unit"),
)


def run(
    run: Run,
    vehicles: Annotated[
        int,
        Option(
            min=1, max=10_000, help="Vehicles; their input in turn: rotor speed, throttle, thrust."
        ),
    ] = 200,
    flights: Annotated[int, Option(min=1, max=100, help="Flights of each vehicle.")] = 3,
    seconds: Annotated[float, Option(min=5.0, max=600.0, help="Length of a flight [s].")] = 30.0,
    pace: Annotated[
        float, Option(min=0.01, max=1.0, help="Of the flights, over the pace drawn; 0.3: calm.")
    ] = 1.0,
    every: Annotated[int, Option(min=1, max=20, help="Every n-th row of a log is kept.")] = 1,
) -> Report:
    """Simulated vehicles of 30 g to 20 kg, identified from their logs. --out DIR: cases to resume
    from.
    """
    flown: dict[str, Any] = {"flights": flights, "seconds": seconds, "pace": pace, "every": every}
    cases = [
        {"seed": run.seed + number, "kind": INPUTS[number % len(INPUTS)]}
        for number in range(vehicles)
    ]
    records = run.cases(
        "identifying", "vehicles", partial(identified, **flown), cases, config=flown
    )
    results(records)
    judged = [{**r["case"], **r["result"]} for r in records if "result" in r]
    pooled = pooled_lines(judged)
    each = quantity_lines(judged)
    title = (
        f"truth inside its 95 % interval; {len(judged)} vehicles, {flights} x "
        f"{seconds:g} s at {pace:g} of the pace, every {every}. row, seeds {run.seed} … "
        f"{run.seed + vehicles - 1}"
    )
    return Report(
        [
            tabulate(title, pooled, POOLED),
            tabulate(
                "a quantity: where it is told, truth inside its interval, and median error",
                each,
                QUANTITY,
            ),
        ],
        config={"vehicles": vehicles, **flown},
        metrics={"pooled": pooled, "table": each, "runs": records},
        notes=failures(records),
    )
