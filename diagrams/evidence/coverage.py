"""Study `coverage`: whether certificates hold. Simulated vehicles are identified and diagnosed from
three logs each, certified, and flown as they truly are.
"""

import dataclasses as dc
from typing import Annotated, Any

import numpy as np
import pandas as pd
from sklearn.preprocessing import PolynomialFeatures
from typer import Option

from diagrams.batch.run import Case, Report, Run, failures, results
from diagrams.certify.certificate import Accepted, Certificate, certify, fly_draws, scenario_content
from diagrams.certify.ranges import Range
from diagrams.evidence.simulated_vehicles import draw_and_fly
from diagrams.evidence.studies.options import Column, fixed, percent, tabulate
from diagrams.gap.corrected import corrected_simulator
from diagrams.loop.experiments import load_experiment
from diagrams.loop.flight import FlightConfig, default_flight
from diagrams.loop.flight_result import fly
from np_drake.diagnosis.diagnose import diagnose
from np_drake.effects.disturbance import DisturbanceConfig
from np_drake.effects.effect_entry import EffectEntry, Posterior
from np_drake.files.yaml_file import filled
from np_drake.identification.identified_vehicle import identified_vehicle
from np_drake.identification.identify import identify
from np_drake.vehicle import Vehicle
from np_drake.vehicle.scaling import usual_rate_loop
from np_drake.vehicle.sources import HALF_WIDTH_95

# that are logged, and their length [s]
FLIGHTS = 3
SECONDS = 30.0
PAYLOAD = (0.02, 0.3)  # over the mass of the vehicle [1]
SPEED = (0.6, 2.0)  # over that of the scaled circle [1]
CORRIDOR = 0.12  # over the radius of the circle [1]
SCORED = 4.0  # of a flight of the paper's vehicle, after its ramp [s]
CLOSE = 0.2  # of a prediction [1]
WIDE = 0.2  # half of a naive interval over its value [1]
# of a certificate
ACCEPTED = Accepted(limit=0.05)
CELLS = 4
LOGGED = 20.0  # of a flight under firmware, after its ramp [s]
TRACKS = ("multisine", "training_circle", "circle")  # of those flights


def known(case: Case) -> dict[str, Any]:
    """Return, of the vehicle of a case {"seed"}, the scenario that its logs describe and the one
    that is true.
    """
    truth, logs, _ = draw_and_fly(case["seed"], "throttle", FLIGHTS, SECONDS)
    mass = truth.vehicle.mass
    battery = truth.throttle.voltage
    vehicle = identified_vehicle(identify(logs, truth.known, mass=mass), "identified")
    answer = diagnose(logs[:-1], logs[-1:], vehicle)
    config = corrected_simulator(answer, vehicle)
    default = default_flight(vehicle)
    reality = config.reality  # in which a payload may hang as a cause
    payload = default.reality.payload if reality.hung.tether == "none" else reality.payload
    corrected = dc.replace(
        config,
        duration=SCORED * default.duration / FlightConfig().duration,
        reality=dc.replace(reality, payload=payload),
        controller=dc.replace(config.controller, kind="hold"),
    )
    hover = truth.throttle.throttle(0.25 * mass * vehicle.gravity, battery)
    assert vehicle.throttle is not None
    thrust = truth.throttle.thrust(hover, battery) / vehicle.throttle.thrust(hover, battery)
    true = dc.replace(
        corrected,
        vehicle=truth.vehicle,
        controller=dc.replace(corrected.controller, vehicle=vehicle),
        reality=dc.replace(
            reality,
            effects=[EffectEntry.of(effect) for effect in (truth.drag, truth.flapping, truth.lift)],
            payload=default.reality.payload,
            thrust_scale=float(thrust),
            posterior=Posterior(),
            disturbance=DisturbanceConfig(),
        ),
    )
    contents = {"corrected": scenario_content(corrected), "true": scenario_content(true)}
    return {**contents, "verdict": list(answer.verdict)}


def known_by_firmware(case: Case) -> dict[str, Any]:
    """Return, of the paper's vehicle under Betaflight in a case {"seed"}, the scenario with the
    rate loop that its logs describe, and the one with its firmware.
    """
    base = Vehicle()
    base = dc.replace(base, rate_loop=usual_rate_loop(base))

    def scenario(track: str, kind: str, vehicle: Vehicle, duration: float) -> FlightConfig:
        config = load_experiment(track, vehicle)
        controller = dc.replace(config.controller, kind="hold")
        return dc.replace(config, duration=duration, controller=controller).with_autopilot(kind)

    logs = [
        dc.replace(fly(scenario(track, "betaflight", base, LOGGED), seed=k).log(), name=track)
        for k, track in enumerate(TRACKS, start=len(TRACKS) * case["seed"])
    ]
    vehicle = identified_vehicle(identify(logs, base, mass=base.mass), "identified")
    true = scenario("circle", "betaflight", base, SCORED)
    true.controller.vehicle = vehicle
    corrected = scenario("circle", "rate_loop", vehicle, SCORED)
    return {"corrected": scenario_content(corrected), "true": scenario_content(true)}


def in_band(predicted: pd.DataFrame, seen: pd.DataFrame) -> float:
    """Return the share of flights whose error E_xy is in the 95 % band that predicted flights give
    for their place [1]; NaN without any.

    The logarithm of the error is quadratic in the place, by least squares, with the prediction
    interval of that; lost flights are in no band.
    """

    def terms(flights: pd.DataFrame) -> tuple[np.ndarray, np.ndarray]:
        place = PolynomialFeatures(2).fit_transform(flights["shares"].tolist())
        return place, np.log(flights["E_xy"].astype(float).to_numpy())

    if not len(seen):
        return np.nan
    A, a = terms(predicted.dropna(subset="E_xy"))
    B, b = terms(seen)
    P = np.linalg.pinv(A)
    within = (
        HALF_WIDTH_95
        * (a - A @ P @ a).std(ddof=A.shape[1])
        * np.sqrt(1 + np.sum((B @ P) ** 2, axis=1))
    )
    return (np.abs(b - B @ P @ a) <= within).mean()


def without_spread(config: FlightConfig) -> FlightConfig:
    """Return the scenario of the mean vehicle, of which nothing is drawn."""
    vehicle = dc.replace(
        config.vehicle, intervals={}, mass_uncertainty=None, thrust_uncertainty=None
    )
    return dc.replace(
        config, vehicle=vehicle, reality=dc.replace(config.reality, posterior=Posterior())
    )


def with_plain_spread(config: FlightConfig) -> FlightConfig:
    """Return the vehicle alone, whose mass, thrust and inertia are known to 20 %."""
    plain = without_spread(config)
    inertia = [
        [one - WIDE * abs(one), one + WIDE * abs(one)] for one in np.ravel(plain.vehicle.inertia)
    ]
    vehicle = dc.replace(
        plain.vehicle,
        intervals={"inertia": inertia},
        mass_uncertainty=WIDE / 2,
        thrust_uncertainty=WIDE / 2,
    )
    reality = dc.replace(plain.reality, effects=[], disturbance=DisturbanceConfig())
    return dc.replace(plain, vehicle=vehicle.check(), reality=reality)


def judged(certificate: Certificate, true: pd.DataFrame) -> dict[str, Any]:
    """Return whether a certificate holds for flights of the vehicle as it truly is, evenly drawn
    over the map: failures in its part within the bound, largest deviation as predicted; None where
    no part was chosen.
    """
    part = certificate.part
    shares = np.array(true["shares"].tolist())
    cell = np.minimum((shares * part.shape).astype(int), np.array(part.shape) - 1)
    inside = true[part[cell[:, 0], cell[:, 1]]]
    flown = len(inside)
    failed = inside["failed"].sum()
    upper = certificate.bound().upper
    seen = inside["peak"].astype(float).fillna(np.inf).quantile(0.95)
    predicted = certificate.quantile("peak", 0.95)
    return {
        "part": part.mean(),
        "some": part.any(),
        "flown": flown,
        "failed": failed,
        "upper": upper,
        "peak_said": predicted,
        "peak_seen": seen,
        "peak_close": abs(predicted - seen) <= CLOSE * seen if flown else None,
        "band": in_band(certificate.flights, inside),
        "covered": failed <= upper * flown if flown else None,
    }


COLUMNS: tuple[Column, ...] = (
    ("drawn from", "row"),
    ("vehicles", "vehicles"),
    ("bound holds", percent("covered")),
    ("some", percent("some")),
    ("part", percent("part")),
    ("peak within 20 %", percent("peak_close")),
    ("E_xy in band", percent("band")),
    ("peak said / seen", fixed("peak_ratio", 2)),
    ("failed", percent("rate", 1)),
)


def run(
    run: Run,
    vehicles: Annotated[int, Option(min=1, max=10_000, help="Simulated vehicles.")] = 20,
    flights: Annotated[int, Option(min=20, max=100_000, help="Flights of a certificate.")] = 120,
    true: Annotated[int, Option(min=20, max=100_000, help="Flights as it truly is.")] = 150,
    firmware: Annotated[bool, Option(help="Of the paper's vehicle under Betaflight.")] = False,
) -> Report:
    """Certificates of simulated vehicles, from their own logs. Beside naive draws; then flown."""
    cases = [{"seed": run.seed + number} for number in range(vehicles)]
    settings = {
        "flights": FLIGHTS,
        "seconds": SECONDS,
        "input": "firmware" if firmware else "throttle",
    }
    work = known_by_firmware if firmware else known
    prepared = run.cases("identified and diagnosed", "vehicles", work, cases, config=settings)
    results(prepared)
    lines = []
    for record in (record for record in prepared if "result" in record):
        corrected, real = (
            filled(FlightConfig(), record["result"][of]) for of in ("corrected", "true")
        )
        mass = corrected.vehicle.mass
        speed = corrected.reference.speed
        over = (
            Range("payload", *(share * mass for share in PAYLOAD)),
            Range("speed", *(share * speed for share in SPEED)),
        )
        within = CORRIDOR * corrected.reference.radius
        seeded = dc.replace(run, seed=record["case"]["seed"])
        flown = fly_draws(real, over, true, within=within, run=seeded)
        for row, config in (
            ("certificate", corrected),
            ("mean vehicle", without_spread(corrected)),
            ("vehicle file ± 20 %", with_plain_spread(corrected)),
        ):
            certificate = certify(
                config,
                over,
                flights=flights,
                within=within,
                cells=CELLS,
                accepted=ACCEPTED,
                run=seeded,
            )
            lines.append({"row": row, "seed": seeded.seed, **judged(certificate, flown)})
    table = summary(pd.DataFrame(lines))
    title = f"{flights} flights a certificate, 95 % sure; {true} of each vehicle as it is; seeds "
    return Report(
        [tabulate(f"{title}{run.seed} … {run.seed + vehicles - 1}", table, COLUMNS)],
        config=settings | {"certificate": flights, "true": true},
        metrics={"table": table, "runs": lines},
        notes=failures(prepared),
    )


def summary(lines: pd.DataFrame) -> list[dict[str, Any]]:
    """Return a line for every way of drawing: shares of the vehicles whose certificate holds."""
    shares = ["covered", "some", "part", "peak_close", "band"]
    lines = lines.astype(dict.fromkeys(shares, float))
    lines["peak_ratio"] = lines["peak_said"] / lines["peak_seen"]
    rows = lines.groupby("row", sort=False)
    table = rows.size().to_frame("vehicles").join(rows[shares].mean())
    table["peak_ratio"] = rows["peak_ratio"].median()
    table["rate"] = rows["failed"].sum() / rows["flown"].sum()
    return table.reset_index().to_dict("records")
