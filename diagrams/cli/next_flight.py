"""`np-drake next-flight`: a random multisine within limits, and what it tells of the explanations that stand."""

import dataclasses as dc
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from typer import Argument, Option

from diagrams.cli import options
from diagrams.cli.output import Table, progress, say
from diagrams.cli.runner import Report, Run, reports

if TYPE_CHECKING:
    from diagrams.gap.limits_check import Flown
    from diagrams.loop.flight import FlightConfig
    from np_drake.effects.explanation import Explanation
    from np_drake.flight_design.prediction import Prediction

Box = tuple[float, float, float]
SPEED, TILT = 0.6, 0.6  # of the controller's own limits, where none is named [1]
SHORTEST, LONGEST = 5.0, 120.0  # flight [s]
HARDLY = 1.0  # distance of a pair below which it is hardly told apart [nat]
MOTION = "multisine"  # name of the motion in the report


@reports("next-flight", seed=0, out=options.Out, markdown=False)
def next_flight(
    run: Run,
    report: Annotated[Path, Argument(metavar="REPORT", help="Folder of np-drake diagnose --out.")],
    box: Annotated[Box, Option("--box", metavar="X Y Z", help="Room [m]: floor at z = 0, x = y = 0 amid.")],
    seconds: Annotated[float, Option("--seconds", min=SHORTEST, max=LONGEST, help="Length [s].")] = 20.0,
    controller: Annotated[str, Option("--controller", help="Kind that will fly it, as of np-drake fly.")] = "hold",
    speed: Annotated[
        float | None, Option("--speed", help="Largest speed [m/s]; default: 0.6 of the controller's.")
    ] = None,
    tilt: Annotated[
        float | None, Option("--tilt", help="Largest tilt [rad]; default: 0.6 of the controller's.")
    ] = None,
    evaluations: Annotated[int | None, Option("--evaluations", min=10, max=1_000_000, hidden=True)] = None,
    no_fly: Annotated[
        bool, Option("--no-fly", help="Leave out the flights in the simulator, and so their check.")
    ] = False,
) -> Report:
    """Write a flight that tells the explanations of a diagnosis apart; fly it in the simulator first."""
    from diagrams.gap.limits_check import InSimulator, keep_limits
    from diagrams.gap.next_flight import RATE, TRACK, read_report, track_figure, write_scenario
    from np_drake.flight_design.limits import limits_for
    from np_drake.flight_design.multisine import random_multisine
    from np_drake.references.track_file import write_trajectory

    found = read_report(report)
    config = with_controller(found.simulator, controller)
    mpc, explanations = config.controller.mpc, found.explanations
    limits = limits_for(
        config.vehicle,
        explanations,
        box=box,
        speed=SPEED * mpc.max_speed if speed is None else speed,
        tilt=TILT * mpc.max_tilt if tilt is None else tilt,
    )
    motion = random_multisine(limits, seconds, seed=run.seed)
    flown: list[Flown] = []
    if not no_fly:
        in_simulator = InSimulator(config, found, limits, run.scratch, run.seed)
        with progress(f"flying with {controller}", 1.0) as advance:
            motion, flown = keep_limits(
                motion, explanations, in_simulator, controller=controller, tell=lambda share: advance(share, "")
            )
    prediction, usage = found.predicted(motion, limits), motion.usage(limits)

    def write(folder: Path) -> None:
        write_trajectory(motion, folder / TRACK, RATE, duration=seconds, vehicle=config.vehicle)
        scenario = write_scenario(config, explanations, folder, found.corrected.resolve())
        say(f"trajectory: {folder / TRACK}", f"scenario: {scenario}")

    settings = {"box": box, "seconds": seconds, "controller": controller, "report": report}
    settings |= {"speed": limits.speed, "tilt": limits.tilt, "fly": not no_fly}
    return Report(
        tables(explanations, prediction, flown),
        config=settings,
        metrics=content(explanations, prediction, usage, flown),
        lines=[sentence(explanations), outlook(prediction), ""],
        summary=[verdict(flown, usage)],
        notes=[] if evaluations is None else ["warning: --evaluations has no effect: nothing is searched for."],
        figures={"next_flight.png": lambda: track_figure(motion, limits)},
        write=write,
    )


def with_controller(config: "FlightConfig", kind: str) -> "FlightConfig":
    """Return the scenario with another kind of controller and the solver of all verbs.

    Args:
        config: the scenario.
        kind: of controller, as of np-drake fly.
    Raises: ValueError: on an unknown kind, or one that cannot fly this vehicle.
    """
    from diagrams.loop.controllers import make_residual_model

    changed = dc.replace(config.controller, kind=kind, solver=options.DEFAULT_SOLVER).check()
    make_residual_model(changed, changed.believed(config.vehicle))  # refused before any work
    return dc.replace(config, name="next_flight", controller=changed)


def sentence(explanations: "Sequence[Explanation]") -> str:
    """Return what still stands, in one line."""
    told = ", ".join(f"{e.label} ({100 * e.probability:.2g} %)" for e in explanations)
    if len(explanations) == 1:
        return f"One explanation stands: {told}. The flight is for its parameters."
    return f"{len(explanations)} explanations stand: {told}."


def outlook(prediction: "Prediction") -> str:
    """Return what the flight is expected to tell, in one line."""
    expected = prediction.information.outlook
    if prediction.information.weakest is None:
        return f"The flight brings {prediction.information.parameters(0):.2g} nat about its parameters."
    return (
        f"The flight leaves one explanation, the right one, with a probability of {100 * expected.named:.0f} %; "
        f"entropy left: {expected.entropy:.2g} nat."
    )


def verdict(flown: "Sequence[Flown]", usage: Mapping[str, float]) -> str:
    """Return whether the limits are kept, in one line.

    Args:
        flown: flights in the simulator, all within the limits; none where it was not flown.
        usage: share of each limit that the plan uses [1].
    """
    if not flown:
        return f"Limits: not flown in the simulator; the plan uses {_most(usage)}."
    worst = max(flown, key=lambda f: f.worst)
    return (
        f"Limits: kept in the simulator under each of {len(flown)} explanations that stand; most used: "
        f"{_most(worst.usage)}, under {worst.explanation.label}."
    )


def _most(usage: Mapping[str, float]) -> str:
    name = max(usage, key=lambda name: usage[name])
    return f"{100 * usage[name]:.0f} % of {name}"


def tables(explanations: "Sequence[Explanation]", prediction: "Prediction", flown: "Sequence[Flown]") -> list[Table]:
    """Return the tables of pairs, of intervals, and of the flights in the simulator.

    Args:
        explanations: that stand, the best first.
        prediction: what the flight tells.
        flown: flights in the simulator.
    """
    found: list[Table] = []
    if pairs := _pairs(explanations, prediction):
        found.append(("what the flight tells apart", ["pair", "distance [nat]", "told apart"], pairs))
    if rows := _intervals(explanations[0], prediction.intervals[0]):
        header = ["if it is " + explanations[0].label, "value", "± now", "± after the flight"]
        found.append(("intervals of 95 %", header, rows))
    if flown:
        header = ["if it is", "its log gives it", "names one", "most used limit"]
        flights = [
            (f.explanation.label, f"{100 * f.posterior[k]:.3g} %", _named(f, k), _most(f.usage))
            for k, f in enumerate(flown)
        ]
        found.append(("the flight in the simulator", header, flights))
    return found


def _pairs(explanations: "Sequence[Explanation]", prediction: "Prediction") -> list[tuple[str, ...]]:
    """Return a row for each pair of explanations, the least separated first."""
    from itertools import combinations

    distances = prediction.information.distances
    pairs = sorted(combinations(range(len(explanations)), 2), key=lambda ij: distances[ij])
    said = [(f"{explanations[i].label} – {explanations[j].label}", distances[i, j]) for i, j in pairs]
    return [(pair, f"{d:.2g}", "hardly" if d < HARDLY else "yes") for pair, d in said]


def _intervals(explanation: "Explanation", intervals: Mapping[str, tuple[float, float]]) -> list[tuple[str, ...]]:
    """Return a row for each parameter of the effects that an explanation names."""
    values = {f"{e.identifier}.{name}": v for e in explanation.effects for name, v in e.values.items()}
    named = {name: pair for name, pair in intervals.items() if name.split(".")[0] in explanation.named}
    return [(name, f"{values[name]:.3g}", f"{a:.2g}", f"{b:.2g}") for name, (a, b) in named.items()]


def _named(flown: "Flown", k: int) -> str:
    from np_drake.effects.explanation import STANDS

    rest = max((p for j, p in enumerate(flown.posterior) if j != k), default=0.0)
    return "yes" if flown.posterior[k] > STANDS * rest else "no"


def content(
    explanations: "Sequence[Explanation]",
    prediction: "Prediction",
    usage: Mapping[str, float],
    flown: "Sequence[Flown]",
) -> dict[str, Any]:
    """Return the values of `--json` (docs/reference/files.md).

    Args:
        explanations: that stand.
        prediction: what the flight tells.
        usage: share of each limit that the plan uses [1].
        flown: flights in the simulator.
    """
    told = prediction.information
    candidate = {
        "name": MOTION,
        "entropy": told.outlook.entropy,
        "named": told.outlook.named,
        "weakest": None if (pair := told.weakest) is None else [explanations[k].label for k in pair],
        "distances": told.distances.tolist(),
        "parameters": [told.parameters(k) for k in range(len(explanations))],
        "intervals": list(prediction.intervals),
        "usage": dict(usage),
    }
    flights = [{"explanation": f.explanation.label, "usage": f.usage, "posterior": f.posterior.tolist()} for f in flown]
    stand = [{"named": list(e.named), "probability": e.probability} for e in explanations]
    return {"explanations": stand, "candidates": [candidate], "flown": flights}
