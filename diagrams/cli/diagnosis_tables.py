"""A diagnosis on the terminal: the answer, what differs, what the model lacks, what remains, and
what to do next.
"""

from diagrams.cli.output import Table
from np_drake.diagnosis.report import words
from np_drake.diagnosis.report.answer import (
    DIFFERENCE_HEADER,
    GAP_HEADER,
    SHOWN,
    cause_table,
    difference_rows,
    gap_rows,
    headline,
    lead,
    named_causes,
    next_steps,
    remains,
    unseen,
    warnings,
)
from np_drake.diagnosis.result import Diagnosis

SENSORS = {"rig": "real", "laboratory": "ideal"}  # value in --json: words
_QUANTITIES = {
    "position [m]": "position",
    "velocity [m/s]": "velocity",
    "attitude [deg]": "attitude",
}


def judgement(diagnosis: Diagnosis) -> list[str]:
    """Return what stands against any answer, the headline, the sentence below it, and the same of a
    second answer.
    """
    before = [f"Before the answer: {doubt}." for doubt in diagnosis.doubts]
    return [*before, headline(diagnosis) + ".", lead(diagnosis), *second_answer(diagnosis), ""]


def tables(diagnosis: Diagnosis) -> list[Table]:
    """Return the tables that have rows, the answer first."""
    refit = diagnosis.refit
    tested = [*filter(None, [unseen(diagnosis)])]
    traces = [(words.described(finding), finding.measurement) for finding in diagnosis.unexplained]
    minor = [(f"{finding.name}: {finding.text}",) for finding in diagnosis.below_threshold]
    differs = "what differs from the vehicle file (calibration, no cause)"
    left = "what remains" if diagnosis.cannot_tell else f"what remains. {remains(diagnosis)}"
    every: list[Table] = [
        (differs, DIFFERENCE_HEADER, difference_rows(diagnosis)),
        *_causes(diagnosis, "what the model lacks"),
        *(_causes(refit, "second answer: what the model lacks") if refit else []),
        (left, GAP_HEADER, gap_rows(diagnosis)),
        *(
            [(f"second answer: what remains. {remains(refit)}", GAP_HEADER, gap_rows(refit))]
            if refit
            else []
        ),
        ("what would end it", ["trace", "measurement"], traces),
        ("what to do next", ["step"], [(text,) for text in next_steps(diagnosis)]),
        ("what the flights tested", ["finding"], [(text,) for text in tested]),
        (
            "replay, median error, nominal → with causes",
            ["horizon [s]", *_QUANTITIES],
            replay_rows(diagnosis),
        ),
        ("minor findings", ["finding"], minor),
    ]
    return [table for table in every if table[-1]]


def _causes(diagnosis: Diagnosis, title: str) -> list[Table]:
    """Return the table of causes, and a list of when they begin and what they cannot be told
    from.
    """
    header, rows = cause_table(diagnosis)
    said = []
    for cause in named_causes(diagnosis):
        begins = [
            words.onset(t, words.plain_name(n)) for n, t in cause.onset.items() if t is not None
        ]
        said += [f"{cause.identifier} begins in {', '.join(begins)}"] if begins else []
        others = words.listed(cause.indistinguishable_from, "or")
        said += [f"{cause.identifier}, or else {others}: these logs cannot tell"] if others else []
    return [
        (title, header[:SHOWN], [row[:SHOWN] for row in rows]),
        ("of these causes", ["said"], [(t,) for t in said]),
    ]


def notes(diagnosis: Diagnosis) -> list[str]:
    """Return the sensors that were assumed, and every warning once."""
    sensors = SENSORS.get(diagnosis.judged_as, diagnosis.judged_as)
    judged = [f"Judged as logs of {sensors} sensors (--rig, --laboratory)."] if sensors else []
    return [*judged, *(f"warning: {text}" for text in warnings(diagnosis))]


def second_answer(diagnosis: Diagnosis) -> list[str]:
    """Return the answer with the first halves of held-out flights in the fit, in two sentences."""
    refit = diagnosis.refit
    if refit is None:
        return []
    first = (
        f"Second answer, with the first halves of {words.flights(len(diagnosis.held_out))} "
        f"in the fit:"
    )
    return ["", f"{first} {headline(refit)}.", lead(refit)]


def replay_rows(diagnosis: Diagnosis) -> list[tuple]:
    """Return a row for every horizon."""
    gaps = [
        gap
        for gap in (diagnosis.gap_reduction.replay_before, diagnosis.gap_reduction.replay_after)
        if gap is not None
    ]
    rows: list[tuple] = []
    for k, horizon in enumerate(gaps[0].horizon if gaps else ()):
        cells = []
        for name in _QUANTITIES.values():
            cells.append(
                " → ".join(words.number(float(getattr(gap, name)[k, 0]), 2) for gap in gaps)
            )
        rows.append((f"{horizon:g}", *cells))
    return rows
