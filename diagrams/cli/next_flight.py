"""`np-drake next-flight`: a flight within limits, and what it tells of the explanations that
stand.
"""

import dataclasses as dc
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from typer import Argument, Option

from diagrams.cli import options
from diagrams.cli.output import progress, say
from diagrams.cli.runner import Report, Run, reports

if TYPE_CHECKING:
    from diagrams.gap.limits_check import Flown
    from diagrams.loop.flight import FlightConfig
    from np_drake.effects.explanation import Explanation
    from np_drake.flight_design.prediction import Prediction

Box = tuple[float, float, float]
SPEED, TILT = 0.6, 0.6  # of the controller's own limits, where none is named [1]
SHORTEST, LONGEST = 5.0, 120.0  # flight [s]


@reports("next-flight", seed=0, out=options.Out, markdown=False)
def next_flight(
    run: Run,
    report: Annotated[Path, Argument(metavar="REPORT", help="Folder of np-drake diagnose --out.")],
    box: Annotated[
        Box, Option("--box", metavar="X Y Z", help="Room [m]: floor at z = 0, x = y = 0 amid.")
    ],
    seconds: Annotated[
        float, Option("--seconds", min=SHORTEST, max=LONGEST, help="Length [s].")
    ] = 20.0,
    controller: Annotated[
        str, Option("--controller", help="Kind that will fly it, as of np-drake fly.")
    ] = "hold",
    speed: Annotated[
        float | None,
        Option("--speed", help="Largest speed [m/s]; default: 0.6 of the controller's."),
    ] = None,
    tilt: Annotated[
        float | None, Option("--tilt", help="Largest tilt [rad]; default: 0.6 of the controller's.")
    ] = None,
    evaluations: Annotated[
        int | None, Option("--evaluations", min=10, max=1_000_000, hidden=True)
    ] = None,
    no_fly: Annotated[
        bool, Option("--no-fly", help="Leave out the flights in the simulator, and so their check.")
    ] = False,
) -> Report:
    """Write a flight that tells the explanations of a diagnosis apart; fly it in the simulator
    first.
    """
    from diagrams.cli.next_flight_tables import finding, hopeless, sentence, tables, verdict
    from diagrams.gap.limits_check import CannotFly, InSimulator, keep_limits
    from diagrams.gap.next_flight import RATE, TRACK, read_report, track_figure, write_scenario
    from np_drake.flight_design.limits import limits_for
    from np_drake.flight_design.manoeuvres import manoeuvres
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
    motions = manoeuvres(limits, seconds, seed=run.seed)
    told = {name: found.predicted(motion, limits) for name, motion in motions.items()}
    checked: dict[str, list[Flown]] = {}
    left_out: dict[str, str] = {}
    name = _ahead(told)
    if not no_fly and not hopeless(told):
        in_simulator = InSimulator(config, found, limits, run.scratch, run.seed)
        while (
            name not in checked
        ):  # what the limits make smaller tells less, and another may then be ahead
            try:
                with progress(f"flying {name} with {controller}", 1.0) as advance:
                    motions[name], checked[name] = keep_limits(
                        motions[name],
                        explanations,
                        in_simulator,
                        controller=controller,
                        limits=limits,
                        tell=lambda share: advance(share, ""),
                    )
                told[name] = found.predicted(motions[name], limits)
            except CannotFly as error:
                left_out[name] = str(error)
                if len(left_out) == len(motions):
                    raise
            name = _ahead(
                {kind: prediction for kind, prediction in told.items() if kind not in left_out}
            )
    motion, flown = motions[name], checked.get(name, [])
    usage = {kind: candidate.usage(limits) for kind, candidate in motions.items()}
    order = [name, *(kind for kind in told if kind != name)]

    def write(folder: Path) -> None:
        write_trajectory(motion, folder / TRACK, RATE, duration=seconds, vehicle=config.vehicle)
        scenario = write_scenario(config, explanations, folder, found.corrected.resolve())
        say(f"trajectory: {folder / TRACK}", f"scenario: {scenario}")

    settings = {"box": box, "seconds": seconds, "controller": controller, "report": report}
    settings |= {"speed": limits.speed, "tilt": limits.tilt, "fly": not no_fly}
    return Report(
        tables(explanations, {kind: told[kind] for kind in order}, flown, left_out),
        config=settings,
        metrics=content(explanations, {kind: told[kind] for kind in order}, usage, flown)
        | {"left_out": left_out},
        lines=[sentence(explanations), finding(explanations, told, flown, name), ""],
        summary=[verdict(flown, usage[name])],
        notes=[
            *(f"{kind} is left out: {why}" for kind, why in left_out.items()),
            *(
                []
                if evaluations is None
                else ["warning: --evaluations has no effect: nothing is searched for."]
            ),
        ],
        figures={"next_flight.png": lambda: track_figure(motion, limits)},
        write=write,
    )


def _ahead(told: "Mapping[str, Prediction]") -> str:
    """Return the manoeuvre that tells most, the multisine where it is even with others."""
    from diagrams.cli.next_flight_tables import rank

    return max(told, key=lambda kind: rank(told[kind]))  # the first of those that are even


def with_controller(config: "FlightConfig", kind: str) -> "FlightConfig":
    """Return the scenario with another kind of controller and the solver of all verbs.
    Raises: ValueError: on an unknown kind, or one that cannot fly this vehicle.
    """
    from diagrams.loop.controller_models import make_residual_model

    changed = dc.replace(config.controller, kind=kind, solver=options.DEFAULT_SOLVER).check()
    make_residual_model(changed, changed.believed(config.vehicle))  # refused before any work
    return dc.replace(config, name="next_flight", controller=changed)


def content(
    explanations: "Sequence[Explanation]",
    told: "Mapping[str, Prediction]",
    usage: Mapping[str, Mapping[str, float]],
    flown: "Sequence[Flown]",
) -> dict[str, Any]:
    """Return the values of `--json` (docs/reference/files.md).

    Args:
        told: by manoeuvre, what it tells; the proposed one first.
        usage: by manoeuvre, share of each limit that it uses [1].
    """
    candidates = [_candidate(explanations, name, told[name], usage[name]) for name in told]
    flights = [
        {"explanation": f.explanation.label, "usage": f.usage, "posterior": f.posterior.tolist()}
        for f in flown
    ]
    stand = [{"named": list(e.named), "probability": e.probability} for e in explanations]
    return {"explanations": stand, "candidates": candidates, "flown": flights}


def _candidate(
    explanations: "Sequence[Explanation]",
    name: str,
    prediction: "Prediction",
    usage: Mapping[str, float],
) -> dict[str, Any]:
    told = prediction.information
    return {
        "name": name,
        "entropy": told.outlook.entropy,
        "named": told.outlook.named,
        "weakest": None
        if (pair := told.weakest) is None
        else [explanations[k].label for k in pair],
        "distances": told.distances.tolist(),
        "parameters": [told.parameters(k) for k in range(len(explanations))],
        "intervals": list(prediction.intervals),
        "usage": dict(usage),
    }
