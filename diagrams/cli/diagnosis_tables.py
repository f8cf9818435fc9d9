"""A diagnosis on the terminal: verdict, causes, ladder, replay, what cannot be told."""

import math

from diagrams.cli.output import print_table, say
from np_drake.diagnosis.report import words
from np_drake.diagnosis.report.verdict import headline, verdict_sentences
from np_drake.diagnosis.result import Diagnosis


def show(diagnosis: Diagnosis) -> None:
    """Prints it, the verdict first; warnings last."""
    say(headline(diagnosis), *(text.replace(words.NBSP, " ") for text in verdict_sentences(diagnosis)))
    say(*(f"Judged as logs of a {name} (--rig, --laboratory)." for name in [diagnosis.judged_as] if name), "")
    tables = (
        ("causes", ["effect", "probability", "parameter", "value", "95 % interval", "onset"], cause_rows),
        ("held-out residual", ["simulator", "residual [noise units]"], ladder_rows),
        ("replay, median error, before → after", ["horizon [s]", *_QUANTITIES], replay_rows),
        ("these logs cannot tell", ["effects", "what would tell"], confusable_rows),
        ("left unexplained, and minor", ["finding", "what was found"], finding_rows),
    )
    for title, header, make in tables:
        rows = make(diagnosis)
        if rows:
            print_table(title, header, rows)
    say(*(f"warning: {text}" for text in dict.fromkeys((*diagnosis.check.warnings, *diagnosis.warnings))))


_QUANTITIES = {"position [m]": "position", "velocity [m/s]": "velocity", "attitude [deg]": "attitude"}


def cause_rows(diagnosis: Diagnosis) -> list[list[str]]:
    """A line a parameter; effect, probability and onset on the first."""
    rows = []
    for cause in diagnosis.causes:
        begins = [begin(t, words.plain_name(n, 16)) for n, t in cause.onset.items() if t is not None]
        effect = " or ".join([cause.identifier, *cause.indistinguishable_from])
        first = [effect, words.probability(cause.probability).replace(words.NBSP, " ")]
        last = ["\n".join(begins) or "from the start"]
        for name, parameter in cause.parameters.items():
            value, bounds = words.estimate(parameter)
            rows.append([*first, name, f"{value} {words.unit_of(parameter.unit)}".strip(), bounds, *last])
            first, last = ["", ""], [""]
    return rows


def begin(time: float, flight: str) -> str:
    """When an effect begins in a flight [s]; infinite: not at all."""
    return f"{flight}: {time:.2f} s" if math.isfinite(time) else f"{flight}: not at all"


def ladder_rows(diagnosis: Diagnosis) -> list[list[str]]:
    """A line a rung."""
    return [[rung.name, words.number(rung.residual)] for rung in diagnosis.shrink.ladder]


def replay_rows(diagnosis: Diagnosis) -> list[list[str]]:
    """A line a horizon."""
    gaps = [gap for gap in (diagnosis.shrink.replay_before, diagnosis.shrink.replay_after) if gap is not None]
    rows = []
    for k, horizon in enumerate(gaps[0].horizon if gaps else ()):
        cells = []
        for name in _QUANTITIES.values():
            cells.append(" → ".join(words.number(float(getattr(gap, name)[k, 0]), 2) for gap in gaps))
        rows.append([f"{horizon:g}", *cells])
    return rows


def confusable_rows(diagnosis: Diagnosis) -> list[list[str]]:
    """A line a set of effects."""
    return [[" | ".join(item.effects), item.manoeuvre] for item in diagnosis.check.not_identifiable]


def finding_rows(diagnosis: Diagnosis) -> list[list[str]]:
    """Traces of what is unknown, then what is significant but immaterial."""
    left = [[finding.name, finding.text] for finding in diagnosis.remains]
    return left + [[f"minor: {finding.name}", finding.text] for finding in diagnosis.minor]
