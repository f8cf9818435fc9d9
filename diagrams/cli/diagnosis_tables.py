"""A diagnosis on the terminal: verdict, causes, ladder, replay, what is not identifiable."""

import math

from diagrams.cli.output import Table
from np_drake.diagnosis.report import words
from np_drake.diagnosis.report.verdict import headline, verdict_sentences
from np_drake.diagnosis.result import Diagnosis


def judgement(diagnosis: Diagnosis) -> list[str]:
    """Return the headline, the verdict in sentences, and the sensors that were assumed."""
    sentences = [text.replace(words.NBSP, " ") for text in verdict_sentences(diagnosis)]
    sensors = SENSORS.get(diagnosis.judged_as, diagnosis.judged_as)
    judged = [f"Judged as logs of {sensors} sensors (--rig, --laboratory)."] if sensors else []
    return [headline(diagnosis), *sentences, *judged, ""]


def tables(diagnosis: Diagnosis) -> list[Table]:
    """Return the tables that have rows."""
    cause_header = ["effect", "probability", "parameter", "value", "95 % interval", "onset"]
    ladder = [(rung.name, words.number(rung.residual)) for rung in diagnosis.shrink.ladder]
    alike = [(" | ".join(item.effects), item.manoeuvre) for item in diagnosis.check.not_identifiable]
    left = [(finding.name, finding.text) for finding in diagnosis.remains]
    left += [(f"minor: {finding.name}", finding.text) for finding in diagnosis.minor]
    every: list[Table] = [
        ("causes", cause_header, cause_rows(diagnosis)),
        ("held-out residual", ["simulator", "residual [noise units]"], ladder),
        ("replay, median error, before → after", ["horizon [s]", *_QUANTITIES], replay_rows(diagnosis)),
        ("these logs cannot tell", ["effects", "what would tell"], alike),
        ("left unexplained, and minor", ["finding", "what was found"], left),
    ]
    return [table for table in every if table[2]]


def warning_lines(diagnosis: Diagnosis) -> list[str]:
    """Return every warning once."""
    return [f"warning: {text}" for text in dict.fromkeys((*diagnosis.check.warnings, *diagnosis.warnings))]


SENSORS = {"rig": "real", "laboratory": "ideal"}  # value in --json: words
_QUANTITIES = {"position [m]": "position", "velocity [m/s]": "velocity", "attitude [deg]": "attitude"}


def cause_rows(diagnosis: Diagnosis) -> list[tuple]:
    """Return a row for every parameter; effect, probability and onset stand on the first."""
    rows: list[tuple] = []
    for cause in diagnosis.causes:
        begins = [begin(t, words.plain_name(n, 16)) for n, t in cause.onset.items() if t is not None]
        effect = " or ".join([cause.identifier, *cause.indistinguishable_from])
        first = [effect, words.probability(cause.probability).replace(words.NBSP, " ")]
        last = ["\n".join(begins) or "from the start"]
        for name, parameter in cause.parameters.items():
            value, bounds = words.estimate(parameter)
            rows.append((*first, name, f"{value} {words.unit_of(parameter.unit)}".strip(), bounds, *last))
            first, last = ["", ""], [""]
    return rows


def begin(time: float, flight: str) -> str:
    """Return when an effect begins in a flight [s]; infinite: not at all."""
    return f"{flight}: {time:.2f} s" if math.isfinite(time) else f"{flight}: not at all"


def replay_rows(diagnosis: Diagnosis) -> list[tuple]:
    """Return a row for every horizon."""
    gaps = [gap for gap in (diagnosis.shrink.replay_before, diagnosis.shrink.replay_after) if gap is not None]
    rows: list[tuple] = []
    for k, horizon in enumerate(gaps[0].horizon if gaps else ()):
        cells = []
        for name in _QUANTITIES.values():
            cells.append(" → ".join(words.number(float(getattr(gap, name)[k, 0]), 2) for gap in gaps))
        rows.append((f"{horizon:g}", *cells))
    return rows
