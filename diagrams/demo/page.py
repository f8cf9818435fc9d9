"""Page of the demo: errors, causes and simulators, from top to bottom."""

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from diagrams.demo.figures import LABELS
from diagrams.demo.story import HELD_OUT, SIMULATORS, Demo
from diagrams.studies.tracking import TRACKS
from np_drake.diagnosis.report import words
from np_drake.diagnosis.report.headline import named_causes
from np_drake.diagnosis.report.page import embedded, style, template_of
from np_drake.diagnosis.result import UNKNOWN, Estimate
from np_drake.files.atomic_file import write_text

FILE, TEMPLATE = "index.html", Path(__file__).with_name("index.html.j2")
FARTHEST = -1  # horizon of the replay that the page states: the last


def write_index(
    demo: Demo, pictures: Mapping[str, bytes], links: Mapping[str, str], folder: Path
) -> Path:
    """Write the page, and return its path.

    Args:
        pictures: PNG bytes by name: of the held-out track its errors and track, and "foretold".
        links: texts of links by the names of files in the same folder.
    Raises: OSError: if it cannot be written.
    """
    template = template_of(TEMPLATE.read_text("utf-8"))
    shown = {name: embedded(picture) for name, picture in pictures.items()}
    write_text(
        folder / FILE, template.render(**content(demo), figures=shown, links=links, style=style())
    )
    return folder / FILE


def content(demo: Demo) -> dict[str, Any]:
    """Return all values that the template uses, with numbers formatted as text."""
    replay = demo.diagnosis.gap_reduction
    return {
        "seeds": demo.seeds,
        "vehicle": demo.training.config.vehicle.name,
        "headline": headline(demo),
        "held_out": HELD_OUT,
        "errors": error_rows(demo),
        "cut": [
            (track, words.percent(cut["E_xy"]), words.percent(cut["E_z"]))
            for track, cut in demo.reduction().items()
        ],
        "causes": cause_rows(demo),
        "meeting": meeting_rows(demo),
        "simulated": words.number(demo.simulated_seconds, 2),
        "replayed": [
            "–" if gap is None else words.measure(float(gap.position[FARTHEST, 0]), "m")
            for gap in (replay.replay_before, replay.replay_after)
        ],
        "horizon": replay.replay_before and f"{replay.replay_before.horizon[FARTHEST]:g}",
    }


def headline(demo: Demo) -> str:
    """Return the answer in one line."""
    cut, found = demo.reduction()[HELD_OUT]["E_xy"], demo.diagnosis.verdict
    right = sum(name in found for name in demo.withheld)
    wrong = len([name for name in found if name not in demo.withheld])
    others = (
        f" and {wrong} that {'is' if wrong == 1 else 'are'} not there" if wrong else " and no other"
    )
    off = max(abs(line["corrected"] / line["flight"] - 1.0) for line in demo.meeting())
    return (
        f"The error falls by {words.percent(cut)}; {right} of {len(demo.withheld)} missing "
        f"effects are named{others}; "
        f"simulator and flight meet within {words.percent(off)}"
    )


def error_rows(demo: Demo) -> list[tuple[str, ...]]:
    """Return (track, controller, E_xy, E_z) of every flight."""
    rows: list[tuple[str, ...]] = []
    for track in TRACKS:
        for flight in [f for f in demo.flights if f.config.name == track]:
            m = flight.metrics()
            rows.append(
                (track, LABELS[flight.config.controller.kind], _cm(m["E_xy"]), _cm(m["E_z"]))
            )
    return rows


def cause_rows(demo: Demo) -> list[tuple[str, ...]]:
    """Return (effect, probability, parameter, found, 95 % interval, withheld), a row for every
    parameter.
    """
    causes = {cause.identifier: cause for cause in named_causes(demo.diagnosis)}
    rows: list[tuple[str, ...]] = []
    for name, cause in causes.items():
        first = (words.capital(words.bare_name(name)), words.probability(cause.probability))
        for parameter, estimate in cause.parameters.items() or [("", None)]:
            true = demo.withheld.get(name, {}).get(parameter)
            if estimate is None or (true == 0.0 and estimate.ci95[0] <= 0.0 <= estimate.ci95[1]):
                continue
            unit = words.unit_of(cause, estimate)
            told = (
                words.NOTHING if true is None else words.estimate(_exact(true, estimate), unit)[0]
            )
            rows.append((*first, parameter, *words.estimate(estimate, unit), told))
            first = ("", "")
    if UNKNOWN in demo.diagnosis.verdict:
        rows.append(
            (
                UNKNOWN,
                words.probability(demo.diagnosis.unknown_probability),
                "",
                "",
                "",
                words.NOTHING,
            )
        )
    missed = [name for name in demo.withheld if name not in causes]
    return rows + [
        (words.capital(words.bare_name(name)), "not named", "", "", "", "acts") for name in missed
    ]


def _exact(true: float, estimate: Estimate) -> Estimate:
    """Return the true value as the estimate is shown: with the digits of its interval."""
    lower, upper = estimate.ci95
    half = 0.5 * (upper - lower)
    return Estimate(true, estimate.unit, (true - half, true + half))


def meeting_rows(demo: Demo) -> list[tuple[str, ...]]:
    """Return (controller, error, flight, nominal simulator, corrected simulator, its
    difference).
    """
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
    return words.fixed(100 * metres, 2) if math.isfinite(metres) else words.NOTHING
