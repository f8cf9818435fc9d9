"""Study `autopilot`: controllers on the firmware, its rate loop, and what simulators predict of
them.
"""

import dataclasses as dc
from typing import Any

import numpy as np

from diagrams.batch.campaign import Case
from diagrams.batch.columns import fixed, spread, tabulate
from diagrams.batch.flown import FlownOptions, FlownRun
from diagrams.batch.options import Duration, Seeds
from diagrams.batch.run import Report, Run, Table
from diagrams.batch.workers import failures, results
from diagrams.gap.corrected import corrected_simulator
from diagrams.gap.step_response import step_responses
from diagrams.loop.experiments import load_experiment
from diagrams.loop.flight import FlightConfig
from diagrams.loop.flight_result import FlightResult, fly
from diagrams.loop.reality import RealityConfig
from np_drake.autopilot.betaflight import find_firmware
from np_drake.diagnosis.diagnose import diagnose
from np_drake.identification.rate_loop import AxisLoop, identify_rate_loop
from np_drake.metrics import half_width
from np_drake.vehicle import Vehicle
from np_drake.vehicle.vehicle import RateLoop

ROWS = ("nominal", "hold", "observer", "np", "payload_filter")
EXPERIMENTS = ("circle", "lemniscate", "hover", "attach")
FIRMWARE, NOMINAL, CORRECTED = "firmware", "nominal simulator", "corrected simulator"
PREDICTED = ("circle", "lemniscate")  # experiments that simulators predict
BESIDE = 3  # flights at most of the experiments in which the vehicle stands [1]
LEARNED_FROM = (
    "training_circle",
    60.0,
)  # experiment and its time [s] from which loop and causes are found
DIAGNOSED = 2  # flights, beside the one that judges [1]


@dc.dataclass(frozen=True)
class Options(FlownOptions):
    """Options of the study."""

    seeds: Seeds = 10
    duration: Duration = 20.0


def flight(
    experiment: str, controller: str, where: str, *, loop: RateLoop, duration: float
) -> FlightConfig:
    """Return a flight of the paper's vehicle with its payload.

    Args:
        where: `FIRMWARE`, or a simulator, in which the loop flies in the firmware's place.
        duration: after the ramp [s].
    """
    config = load_experiment(experiment, dc.replace(Vehicle(), rate_loop=loop))
    config = dc.replace(config, duration=duration).with_autopilot(
        "betaflight" if where == FIRMWARE else "rate_loop"
    )
    config.controller.kind = controller
    return config.check_and_step()


@dc.dataclass(frozen=True)
class Flying:
    """Work of a flight: {"experiment", "row", "where", "seed"} -> errors.

    loop: of the vehicle file.
    reality: by simulator, what acts beyond the file.
    duration: after the ramp [s].
    """

    loop: RateLoop
    reality: dict[str, RealityConfig]
    duration: float

    def __call__(self, case: Case) -> dict:
        """Fly the case."""
        where = case["where"]
        config = flight(
            case["experiment"], case["row"], where, loop=self.loop, duration=self.duration
        )
        if where in self.reality:
            config = dc.replace(config, reality=self.reality[where]).check_and_step()
        measured = fly(config, seed=case["seed"]).metrics()
        kept = {name: measured[name] for name in ("E_xy", "E_z", "solve_failures")}
        return {name: case[name] for name in ("experiment", "row", "where", "seed")} | kept


def run(run: Run, options: Options) -> Report:
    """Every controller on Betaflight's firmware; its rate loop identified; E_xy predicted by
    simulators.
    Raises: ValueError: where there is no firmware.
    """
    find_firmware()
    run = FlownRun.of(run, options)
    with run.progress("learning the rate loop and the causes", 4.0) as advance:
        flown = [_learned(run.seed + 1000 * k) for k in range(DIAGNOSED + 1)]
        advance(1.0)
        loops = identify_rate_loop([flown[0].log()])
        if loops is None:
            raise ValueError("autopilot: the training flight shows no rate loop.")
        steps = step_responses(Vehicle(), RealityConfig())
        advance(2.0)
        logs = [dc.replace(one.log(), name=f"minute {k + 1}") for k, one in enumerate(flown)]
        found = diagnose(Vehicle(), logs[:DIAGNOSED], logs[DIAGNOSED:])
        advance(4.0)
    loop = RateLoop([one.lag for one in loops], [one.gain for one in loops]).check()
    nominal, corrected = RealityConfig().nominal(), corrected_simulator(found, Vehicle()).reality
    cases = [
        {"experiment": experiment, "row": row, "where": where, "seed": seed}
        for where in (FIRMWARE, NOMINAL, CORRECTED)
        for experiment in (EXPERIMENTS if where == FIRMWARE else PREDICTED)
        for row in ROWS
        for seed in (run.seeds if experiment in PREDICTED else run.seeds[:BESIDE])
    ]
    work = Flying(loop, {NOMINAL: nominal, CORRECTED: corrected}, options.duration)
    causes = [{"effect": c.identifier, "probability": c.probability} for c in found.causes]
    config = {
        **run.settings,
        "duration": options.duration,
        "loop": dc.asdict(loop),
        "causes": causes,
    }
    records = run.cases("autopilot", "flights", work, cases, config=config)
    lines = _lines(results(records))
    title = (
        f"{run.count} flights a row of {options.duration:g} s, seeds {run.seeds[0]} … "
        f"{run.seeds[-1]}"
    )
    lost = failures(run.workers.finished)
    return Report(
        [_loops(loops, steps), _errors(lines, title), _predicted(lines)],
        config=config,
        metrics={"table": lines, "loop": [dc.asdict(one) for one in loops], "lost": len(lost)},
        notes=[f"lost or not armed: {len(lost)} of {len(cases)} flights", *lost],
    )


def _learned(seed: int) -> FlightResult:
    experiment, duration = LEARNED_FROM
    return fly(flight(experiment, "hold", FIRMWARE, loop=RateLoop(), duration=duration), seed=seed)


def _lines(flown: list[dict]) -> list[dict[str, Any]]:
    """Return mean errors with the half width of their interval, a line for every experiment,
    controller and place.
    """
    lines = []
    for key in dict.fromkeys((f["where"], f["experiment"], f["row"]) for f in flown):
        own = [f for f in flown if (f["where"], f["experiment"], f["row"]) == key]
        line: dict[str, Any] = dict(zip(("where", "experiment", "row"), key, strict=True))
        for name in ("E_xy", "E_z"):
            values = np.array([f[name] for f in own])
            line |= {name: float(values.mean()), f"{name}_ci95": half_width(values)}
        lines.append(
            line | {"flights": len(own), "solve_failures": sum(f["solve_failures"] for f in own)}
        )
    for line in lines:
        same = [
            one
            for one in lines
            if (one["where"], one["experiment"]) == (line["where"], line["experiment"])
        ]
        line["over_nominal"] = line["E_xy"] / next(
            (one["E_xy"] for one in same if one["row"] == "nominal"), np.nan
        )
    return lines


def _loops(loops: tuple[AxisLoop, ...], steps: list) -> Table:
    rows = [
        (
            axis,
            round(1e3 * one.lag, 1),
            round(1e3 * step.lag, 1),
            f"{100 * (one.lag / step.lag - 1):+.0f} %",
            round(one.gain, 3),
            round(step.gain, 3),
            f"{100 * (one.gain / step.gain - 1):+.0f} %",
            round(step.largest, 2),
        )
        for axis, one, step in zip(("roll", "pitch", "yaw"), loops, steps, strict=True)
    ]
    header = [
        "axis",
        "lag [ms]",
        "of a step",
        "off",
        "gain [1]",
        "of a step",
        "off",
        "overshoot to",
    ]
    experiment, seconds = LEARNED_FROM
    return (
        (
            f"rate loop of the firmware, identified from {seconds:g} s of {experiment}, and "
            f"its step response"
        ),
        header,
        rows,
    )


def _errors(lines: list[dict], title: str) -> Table:
    columns = (
        ("experiment", "experiment"),
        ("controller", "row"),
        ("E_xy [cm]", spread("E_xy")),
        ("over nominal", fixed("over_nominal", 2)),
        ("E_z [cm]", spread("E_z")),
        ("flights", "flights"),
        ("failed solves", "solve_failures"),
    )
    return tabulate(
        f"with the firmware; {title}", [one for one in lines if one["where"] == FIRMWARE], columns
    )


def _predicted(lines: list[dict]) -> Table:
    known = {(line["where"], line["experiment"], line["row"]): line["E_xy"] for line in lines}
    rows = []
    for (where, experiment, row), true in known.items():
        if where != FIRMWARE or experiment not in PREDICTED:
            continue
        cells = [f"{100 * true:.2f}"]
        for simulator in (NOMINAL, CORRECTED):
            told = known.get((simulator, experiment, row), np.nan)
            cells += [f"{100 * told:.2f}", f"{100 * (told / true - 1):+.0f} %"]
        rows.append((experiment, row, *cells))
    header = ["experiment", "controller", "firmware", NOMINAL, "off", CORRECTED, "off"]
    return "E_xy [cm] with the firmware, and as simulators predict it", header, rows
