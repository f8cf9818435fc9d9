"""Files of the demo: logs, figures, replay pages, report, corrected simulator, and the page that
shows them from top to bottom.
"""

from pathlib import Path
from typing import Any

import numpy as np

from diagrams.demo.story import FORETOLD, HELD_OUT, LEARNED, SIMULATORS, Demo, until
from diagrams.evidence.studies.tracking import TRACKS
from diagrams.gap import corrected, side_by_side
from diagrams.loop import flight_figures
from diagrams.loop.flight_result import FlightResult
from diagrams.loop.replay import position_error, write_replay
from np_drake.diagnosis.report import words
from np_drake.diagnosis.report.diagnosis_page import write_report
from np_drake.diagnosis.result import UNKNOWN, Estimate
from np_drake.files.figure_file import DASHES, PALETTE, Figure, new_figure
from np_drake.files.page import Section, write_page
from np_drake.logs.formats.log_file import write_log

Rows = list[tuple[str, ...]]  # of a table
FILE = "index.html"
TEMPLATE = Path(__file__).with_name("index.html.j2")
LABELS = {
    "nominal": "nominal MPC",
    "hold": "hold",
    "np": "NP-MPC (np)",
    "payload_filter": "MPC with payload_filter",
}


def write_demo(demo: Demo, folder: Path) -> Path:
    """Write everything to a folder, and return the path of the page to begin with.
    Raises: OSError: if a file cannot be written.
    """
    vehicle = demo.training.config.vehicle
    simulator = corrected.corrected_simulator(demo.diagnosis, vehicle)
    corrected.write_corrected(simulator, demo.diagnosis, folder / corrected.FILE)
    side_by_side.write_side_by_side(demo.replays, vehicle, folder / side_by_side.FILE)
    simulators = {
        side_by_side.FILE: f"The {HELD_OUT} beside its simulators",
        corrected.FILE: "Corrected simulator",
    }
    report = write_report(demo.diagnosis, folder, seed=demo.seed, links=simulators)
    links = {report.name: "Report of the diagnosis", **simulators}
    for flight in (demo.training, *demo.flights.values()):
        write_log(flight.log(), folder / f"{flight.config.name}_{flight.label}.csv")
    for track in TRACKS:
        name = f"{track}_{LEARNED.kind}_replay.html"
        write_replay(demo.flights[track, LEARNED.kind], folder / name)
        links[name] = f"NP-MPC on the {track}"
    sections = [Section(TEMPLATE, content(demo) | {"links": links})]
    return write_page(folder / FILE, "np_drake demo", sections, figures(demo), closed=False)


def figures(demo: Demo) -> dict[str, Figure]:
    """Return the figures by name."""
    flights = [flight for (track, _), flight in demo.flights.items() if track == HELD_OUT]
    title = f"{HELD_OUT} · seed {flights[0].seed}"
    return {
        "foretold": foretold(demo),
        f"{HELD_OUT}_track": flight_figures.plane_track(flights, title),
        f"{HELD_OUT}_errors": flight_figures.errors(flights, title),
    }


def foretold(demo: Demo) -> Figure:
    """Return the position error of the held-out track against time, in flight and as either
    simulator foretells it, a panel a controller.
    """
    figure, grid = new_figure(len(FORETOLD), 1, width=8.0, height=4.6, sharex=True)
    for ax, row in zip(grid[:, 0], FORETOLD, strict=True):
        flight = until(demo.flights[HELD_OUT, row.kind], demo.simulated_seconds)
        ax.plot(*_error(flight), color="0.1", linewidth=2.2, alpha=0.55, label="flight")
        for k, name in enumerate(SIMULATORS):
            style = {"color": PALETTE[1 - k], "linestyle": DASHES[1 - k], "linewidth": 1.2}
            ax.plot(*_error(demo.simulated[name, row.kind]), label=f"{name} simulator", **style)
        ax.set(ylabel="position error [cm]", title=LABELS[row.kind], ylim=(0, None))
        ax.grid(alpha=0.3)
        ax.margins(x=0)
    grid[-1, 0].set_xlabel("time [s]")
    shown = grid[0, 0].get_legend_handles_labels()
    figure.legend(*shown, loc="outside upper center", ncols=3, frameon=False)
    return figure


def _error(flight: FlightResult) -> tuple[np.ndarray, np.ndarray]:
    """Return the scored times [s] and the distance from the reference there [cm]."""
    rows = flight.scored
    return flight.signals["t"][rows], 100 * position_error(flight)[rows]


def content(demo: Demo) -> dict[str, Any]:
    """Return all values that the template uses, with numbers formatted as text."""
    gaps = demo.diagnosis.gap_reduction.replay_before, demo.diagnosis.gap_reduction.replay_after
    return {
        "seeds": demo.seeds,
        "vehicle": demo.training.config.vehicle.name,
        "headline": headline(demo),
        "held_out": HELD_OUT,
        "errors": [
            (track, LABELS[kind], *(_cm(flight.metrics()[name]) for name in ("E_xy", "E_z")))
            for (track, kind), flight in demo.flights.items()
        ],
        "cut": [
            (track, words.percent(cut["E_xy"]), words.percent(cut["E_z"]))
            for track, cut in demo.reduction().items()
        ],
        "causes": cause_rows(demo),
        "meeting": meeting_rows(demo),
        "simulated": words.number(demo.simulated_seconds, 2),
        "replayed": [
            words.measure(None if gap is None else gap.position[-1, 0], "m") for gap in gaps
        ],
        "horizon": gaps[0] and f"{gaps[0].horizon[-1]:g}",
    }


def headline(demo: Demo) -> str:
    """Return the answer in one line."""
    cut = demo.reduction()[HELD_OUT]["E_xy"]
    verdict = demo.diagnosis.verdict
    right = sum(name in verdict for name in demo.withheld)
    wrong = len(set(verdict) - set(demo.withheld))
    others = f"{wrong} that {'is' if wrong == 1 else 'are'} not there" if wrong else "no other"
    off = max(abs(line["corrected"] / line["flight"] - 1.0) for line in demo.meeting())
    return (
        f"The error falls by {words.percent(cut)}; {right} of {len(demo.withheld)} missing "
        f"effects are named and {others}; simulator and flight meet within {words.percent(off)}"
    )


def cause_rows(demo: Demo) -> Rows:
    """Return (effect, probability, parameter, found, 95 % interval, withheld), a row for every
    parameter.
    """
    causes = {cause.identifier: cause for cause in words.named_causes(demo.diagnosis)}
    rows: Rows = []
    for name, cause in causes.items():
        first = (words.capital(words.bare_name(name)), words.probability(cause.probability))
        for parameter, estimate in cause.parameters.items():
            true = demo.withheld.get(name, {}).get(parameter)
            low, high = estimate.ci95
            if true == 0.0 and low <= 0.0 <= high:
                continue
            truth = words.NOTHING
            unit = words.unit_of(cause, estimate)
            if true is not None:  # with the digits of the interval
                half = 0.5 * (high - low)
                exact = Estimate(true, estimate.unit, (true - half, true + half))
                truth = words.estimate(exact, unit)[0]
            rows.append((*first, parameter, *words.estimate(estimate, unit), truth))
            first = ("", "")
    if UNKNOWN in demo.diagnosis.verdict:
        probability = words.probability(demo.diagnosis.unknown_probability)
        rows.append((UNKNOWN, probability, "", "", "", words.NOTHING))
    missed = [name for name in demo.withheld if name not in causes]
    return rows + [
        (words.capital(words.bare_name(name)), "not named", "", "", "", "acts") for name in missed
    ]


def meeting_rows(demo: Demo) -> Rows:
    """Return (controller, error, flight, nominal, corrected simulator, its difference)."""
    return [
        (
            LABELS[line["controller"]],
            line["error"],
            *(_cm(line[name]) for name in ("flight", *SIMULATORS)),
            words.percent(line["corrected"] / line["flight"] - 1.0),
        )
        for line in demo.meeting()
    ]


def _cm(metres: float) -> str:
    return words.fixed(100 * metres, 2) if np.isfinite(metres) else words.NOTHING
