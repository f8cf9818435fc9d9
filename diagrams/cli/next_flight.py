"""`np-drake next-flight`: the flight that best separates the explanations that a diagnosis leaves."""

import dataclasses as dc
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from typer import Argument, Option

from diagrams.cli import options
from diagrams.cli.output import Table, progress, say
from diagrams.cli.runner import Report, Run, reports

if TYPE_CHECKING:
    from diagrams.gap.flown_design import Flown
    from diagrams.loop.flight import FlightConfig
    from np_drake.effects.explanation import Explanation
    from np_drake.flight_design.design import Candidate, FlightDesigner

Box = tuple[float, float, float]
SPEED, TILT = 0.6, 0.6  # of the controller's own limits, where none is named [1]
SHORTEST, LONGEST = 5.0, 120.0  # flight [s]


@reports("next-flight", seed=0, out=options.Out, markdown=False)
def next_flight(
    run: Run,
    report: Annotated[Path, Argument(metavar="REPORT", help="Folder of np-drake diagnose --out.")],
    box: Annotated[Box, Option("--box", metavar="X Y Z", help="Room [m]: floor at z = 0, x = y = 0 amid.")],
    seconds: Annotated[float, Option("--seconds", min=SHORTEST, max=LONGEST, help="Length [s].")] = 20.0,
    controller: Annotated[
        str, Option("--controller", help="Kind that will fly it, as of np-drake fly.")
    ] = "hold",
    speed: Annotated[
        float | None, Option("--speed", help="Largest speed [m/s]; default: 0.6 of the controller's.")
    ] = None,
    tilt: Annotated[
        float | None, Option("--tilt", help="Largest tilt [rad]; default: 0.6 of the controller's.")
    ] = None,
    evaluations: Annotated[
        int, Option("--evaluations", min=10, max=1_000_000, help="Budget of the search, about 50 ms each.")
    ] = 300,
    no_fly: Annotated[
        bool, Option("--no-fly", help="Leave out the flights in the simulator, and so their check.")
    ] = False,
) -> Report:
    """Design the flight that best separates the explanations a diagnosis leaves; fly it in the simulator first."""
    from diagrams.gap.flown_design import FILE, RATE, InSimulator, keep_limits
    from diagrams.gap.next_flight import read_report, write_scenario
    from np_drake.flight_design.design import FlightDesigner
    from np_drake.flight_design.limits import limits_for
    from np_drake.references.track_file import write_trajectory

    found = read_report(report)
    config = with_controller(found.simulator, controller)
    mpc = config.controller.mpc
    limits = limits_for(
        config.vehicle,
        found.explanations,
        box=box,
        speed=SPEED * mpc.max_speed if speed is None else speed,
        tilt=TILT * mpc.max_tilt if tilt is None else tilt,
    )
    designer = FlightDesigner(found.explanations, found.readings, limits, seconds, found.accelerations)
    with progress("designing", 1.0) as advance:
        best, *naive = designer.candidates(
            evaluations=evaluations, seed=run.seed, tell=lambda share: advance(share, "")
        )
    flown: list[Flown] = []
    if not no_fly:
        with progress(f"flying with {controller}", 1.0) as advance:
            best, flown = keep_limits(
                best,
                designer,
                InSimulator(config, designer, run.scratch, run.seed),
                controller=controller,
                tell=lambda share: advance(share, ""),
            )

    def write(folder: Path) -> None:
        write_trajectory(best.reference, folder / FILE, RATE, duration=seconds, vehicle=config.vehicle)
        scenario = write_scenario(config, found.explanations, folder, report.resolve())
        say(f"trajectory: {folder / FILE}", f"scenario: {scenario}")

    def figure():
        from diagrams.gap.design_figures import design_figure

        return design_figure(best, designer)

    settings = {"box": box, "seconds": seconds, "controller": controller, "evaluations": evaluations}
    settings |= {"report": report, "speed": limits.speed, "tilt": limits.tilt, "fly": not no_fly}
    return Report(
        tables(designer, [best, *naive], flown),
        config=settings,
        metrics=content(designer, [best, *naive], flown),
        lines=[sentence(found.explanations), ""],
        notes=[] if flown else ["Not flown in the simulator: its limits are those of the plan alone."],
        figures={"next_flight.png": figure},
        write=write,
    )


def with_controller(config: "FlightConfig", kind: str) -> "FlightConfig":
    """Return the scenario with another kind of controller and the solver of all verbs.

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
        return f"One explanation stands: {told}. The flight is designed for its parameters."
    return f"{len(explanations)} explanations stand: {told}."


def tables(
    designer: "FlightDesigner", candidates: "Sequence[Candidate]", flown: "Sequence[Flown]"
) -> list[Table]:
    """Return the candidates beside each other, and the flights of the first in the simulator."""
    every = designer.explanations
    rows = []
    for c in candidates:
        outlook, weakest = c.information.outlook, c.information.weakest
        pair = "" if weakest is None else " – ".join(every[k].label for k in weakest)
        apart = "" if weakest is None else f"{c.information.distances[weakest]:.2g}"
        margin = f"{100 * (1 - c.usage[c.tightest]):.0f} % of {c.tightest}"
        rows.append((c.name, f"{outlook.entropy:.2g}", f"{100 * outlook.named:.0f} %", pair, apart, margin))
    header = [
        "candidate",
        "entropy left [nat]",
        "names one",
        "weakest pair",
        "distance [nat]",
        "least margin",
    ]
    found: list[Table] = [("what a flight tells", header, rows)]
    if flown:
        header = ["if it is", "its log gives it", "names one", "most used limit"]
        found.append(("the design in the simulator", header, [_flight_row(designer, f) for f in flown]))
    return found


def _flight_row(designer: "FlightDesigner", flown: "Flown") -> tuple[str, ...]:
    k = [e is flown.explanation for e in designer.explanations].index(True)
    limit = max(flown.usage, key=lambda name: flown.usage[name])
    used = f"{100 * flown.usage[limit]:.0f} % of {limit}"
    return (flown.explanation.label, f"{100 * flown.posterior[k]:.3g} %", _named(flown, k), used)


def _named(flown: "Flown", k: int) -> str:
    from np_drake.effects.explanation import STANDS

    rest = max((p for j, p in enumerate(flown.posterior) if j != k), default=0.0)
    return "yes" if flown.posterior[k] > STANDS * rest else "no"


def content(
    designer: "FlightDesigner", candidates: "Sequence[Candidate]", flown: "Sequence[Flown]"
) -> dict[str, Any]:
    """Return the values of `--json` (docs/reference/files.md)."""
    every = designer.explanations
    rows = [
        {
            "name": c.name,
            "value": c.information.value,
            "entropy": c.information.outlook.entropy,
            "named": c.information.outlook.named,
            "weakest": None if (pair := c.information.weakest) is None else [every[k].label for k in pair],
            "distances": c.information.distances.tolist(),
            "parameters": [c.information.parameters(k) for k in range(len(every))],
            "usage": dict(c.usage),
        }
        for c in candidates
    ]
    flights = [
        {"explanation": f.explanation.label, "usage": f.usage, "posterior": f.posterior.tolist()}
        for f in flown
    ]
    stand = [{"named": list(e.named), "probability": e.probability} for e in every]
    return {"explanations": stand, "candidates": rows, "flown": flights}
