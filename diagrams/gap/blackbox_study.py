"""Study `blackbox`: what `identify` and `diagnose` find in the log that Betaflight's firmware
writes itself.
"""

import dataclasses as dc
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from diagrams.batch.campaign import Case
from diagrams.batch.options import Duration
from diagrams.batch.run import Report, Run, Table
from diagrams.batch.workers import failures, results
from diagrams.gap.step_response import step_responses
from diagrams.loop.common_numbers import with_payload
from diagrams.loop.experiments import load_experiment
from diagrams.loop.flight import FlightConfig
from diagrams.loop.flight_result import fly
from diagrams.loop.reality import RealityConfig
from np_drake.autopilot.betaflight import find_firmware
from np_drake.diagnosis.diagnose import diagnose
from np_drake.flight_log import FlightLog
from np_drake.identification.identify import identify
from np_drake.logs.opening import open_flights
from np_drake.vehicle import Vehicle
from np_drake.vehicle.vehicle import RateLoop

FILTERS = {
    "as delivered": [],
    "acc_lpf_hz = 0": ["set acc_lpf_hz = 0"],
}  # lines of the firmware's command line
PAYLOADS = {"no payload": 0.0, "payload": None}  # mass [kg]; None: the experiment's
FLIGHTS = 3  # with a payload, the last of which judges the diagnosis [1]
IDLE = 0.055  # motor output at no throttle; source: the firmware's default of motor_idle [1]


@dc.dataclass(frozen=True)
class Options:
    """Options of the study."""

    duration: Duration = 60.0


def flight(filters: str, payload: str, duration: float) -> FlightConfig:
    """Return a training circle on the firmware.

    Args:
        filters: key of `FILTERS`.
        payload: key of `PAYLOADS`.
        duration: after the ramp [s].
    """
    config = load_experiment("training_circle", dc.replace(Vehicle(), rate_loop=RateLoop()))
    config = with_payload(
        dc.replace(config, duration=duration), mass=PAYLOADS[payload]
    ).with_autopilot("betaflight")
    config.controller.kind, config.autopilot.betaflight.lines = "hold", FILTERS[filters]
    return config.check_and_step()


@dc.dataclass(frozen=True)
class Finding:
    """Work of a case: {"filters", "payload", "seed"} -> what is found in the firmware's logs.

    duration: of a flight after the ramp [s].
    """

    duration: float

    def __call__(self, case: Case) -> dict:
        """Fly, identify and, with a payload, diagnose."""
        config = flight(case["filters"], case["payload"], self.duration)
        count = FLIGHTS if case["payload"] == "payload" else 1
        boxes = [fly(config, seed=case["seed"] + k).blackbox for k in range(count)]
        logs = [_opened(box, f"flight {k + 1}") for k, box in enumerate(boxes)]
        found = identify(logs[:1], Vehicle(), mass=Vehicle().mass, drive="throttle")
        values = {q.name: q.value for q in found.quantities}
        values |= {
            f"rate loop {axis}": one.lag for axis, one in zip("xyz", found.rate_loop, strict=False)
        }
        causes = []
        if count > 1:
            result = diagnose(Vehicle(), logs[:-1], logs[-1:])
            causes = [{"effect": c.identifier, "probability": c.probability} for c in result.causes]
        return {
            **{name: case[name] for name in ("filters", "payload")},
            "values": values,
            "causes": causes,
        }


def _opened(box: bytes, name: str) -> FlightLog:
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "flight.bbl"
        file.write_bytes(box)
        return dc.replace(open_flights(file, Vehicle())[0][0], name=name)


def settings() -> dict[str, float]:
    """Return what is set of vehicle and firmware, by the name of the quantity that tells it
    [SI].
    """
    vehicle, reality = Vehicle(), RealityConfig()
    full = vehicle.max_rotor_thrust * reality.thrust_scale
    speed = np.sqrt(0.25 * vehicle.mass * vehicle.gravity / full)  # over that at full throttle
    u = (speed - IDLE) / (1 - IDLE)  # throttle of the log, from idle
    loops = {
        f"rate loop {axis}": one.lag
        for axis, one in zip("xyz", step_responses(vehicle, reality), strict=True)
    }
    return {
        **{f"inertia {axis}{axis}": vehicle.J[k, k] for k, axis in enumerate("xyz")},
        "torque over thrust": vehicle.torque_coefficient / vehicle.thrust_coefficient,
        "time constant up": reality.motor_lag,
        "time constant down": reality.motor_lag,
        "thrust at full throttle": full,
        "linear share of throttle": float((speed**2 - u * u) / (u - u * u)),
        **{f"gain of rotor {k + 1}": 1.0 for k in range(4)},
        **loops,
    }


def run(run: Run, options: Options) -> Report:
    """What identify and diagnose find in the firmware's own log, beside what is set.
    Raises: ValueError: where there is no firmware.
    """
    find_firmware()
    cases = [{"filters": f, "payload": p, "seed": run.seed + 1} for f in FILTERS for p in PAYLOADS]
    config = {"duration": options.duration, "seed": run.seed}
    found = results(run.cases("blackbox", "logs", Finding(options.duration), cases, config=config))
    lost, truth = failures(run.workers.finished), settings()
    return Report(
        [_quantities(truth, found, options.duration), _causes(found)],
        config=config,
        metrics={"set": truth, "found": found},
        notes=lost,
    )


def _quantities(truth: dict[str, float], found: list[dict[str, Any]], duration: float) -> Table:
    rows = []
    for name, value in truth.items():
        cells = []
        for one in found:
            own = one["values"].get(name)
            cells.append("–" if own is None else f"{own:.3g} ({_off(own, value)})")
        rows.append((name, f"{value:.3g}", *cells))
    header = ["quantity [SI]", "set", *(f"{one['filters']}, {one['payload']}" for one in found)]
    return (f"identified from {duration:g} s of the firmware's log", header, rows)


def _off(value: float, truth: float) -> str:
    return f"{100 * (value / truth - 1):+.0f} %"


def _causes(found: list[dict[str, Any]]) -> Table:
    diagnosed = [one for one in found if one["causes"]]
    names = sorted({cause["effect"] for one in diagnosed for cause in one["causes"]})
    rows = []
    for name in names:
        of = [
            next((c["probability"] for c in one["causes"] if c["effect"] == name), None)
            for one in diagnosed
        ]
        rows.append((name, *("–" if p is None else f"{p:.2f}" for p in of)))
    title = (
        f"causes that diagnose names in {FLIGHTS - 1} flights with the payload, and their "
        f"probability"
    )
    return (title, ["effect", *(one["filters"] for one in diagnosed)], rows)
