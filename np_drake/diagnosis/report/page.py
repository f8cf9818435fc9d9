"""HTML page of the report: the template's content as plain text, with figures and style embedded."""

import base64
import math
from collections.abc import Mapping, Sequence
from importlib import resources
from importlib.metadata import version
from typing import Any

from jinja2 import Environment, StrictUndefined

from np_drake.diagnosis.report import words
from np_drake.diagnosis.report.verdict import has_gap, headline, verdict_sentences
from np_drake.diagnosis.result import Cause, ChannelGap, Diagnosis, Finding, ReplayGap

TEMPLATE = "report.html.j2"
SEEN = 1.05  # residual over noise below which a channel has no gap [1]; own choice


def render(diagnosis: Diagnosis, figures: Mapping[str, bytes], *, seed: int = 0) -> str:
    """Return the HTML page.

    Args:
        diagnosis: the result to show.
        figures: PNG bytes by figure name.
        seed: seed of the diagnosis, which the page states.
    """
    environment = Environment(
        autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True
    )
    source = resources.files("np_drake.diagnosis.report").joinpath(TEMPLATE).read_text(encoding="utf-8")
    pictures = {name: base64.b64encode(png).decode("ascii") for name, png in figures.items()}
    return environment.from_string(source).render(**content(diagnosis, seed), figures=pictures)


def content(diagnosis: Diagnosis, seed: int) -> dict[str, Any]:
    """Return all values that the template uses, with numbers formatted as text."""
    check, reduction = diagnosis.check, diagnosis.shrink
    return {
        "headline": headline(diagnosis),
        "sentences": verdict_sentences(diagnosis),
        "tiles": _tiles(diagnosis),
        "cannot_tell": diagnosis.cannot_tell,
        "largest": _largest(diagnosis.where.channels),
        "channels": [_channel_row(c) for c in diagnosis.where.channels],
        "causes": [_cause(cause, len(diagnosis.train + diagnosis.held_out)) for cause in diagnosis.causes],
        "confusables": [
            {
                "effects": words.listed([words.name_of(e) for e in item.effects], "or"),
                "because": item.because,
                "manoeuvre": item.manoeuvre,
            }
            for item in check.not_identifiable
        ],
        "replay": _replay_rows(reduction.replay_before, reduction.replay_after),
        "starts": next((g.starts for g in (reduction.replay_before, reduction.replay_after) if g), 0),
        "remains": [_finding(finding) for finding in diagnosis.remains],
        "minor": [_finding(finding) for finding in diagnosis.minor],
        "unknown": words.probability(diagnosis.unknown_probability),
        "usable": check.usable,
        "excitation": [(name, words.number(value)) for name, value in check.excitation.items()],
        "noise_floor": [(name, words.number(value)) for name, value in check.noise_floor.items()],
        "warnings": list(dict.fromkeys([*check.warnings, *diagnosis.warnings])),
        "flights": [*((name, "fit") for name in diagnosis.train), *_judges(diagnosis)],
        "vehicle": diagnosis.vehicle,
        "facts": [
            ("vehicle", diagnosis.vehicle),
            ("judged as logs of a", diagnosis.judged_as or "–"),
            ("np_drake", version("np_drake")),
            ("seed", str(seed)),
            ("computed in", f"{words.number(diagnosis.wall)} s"),
        ],
    }


def _tiles(diagnosis: Diagnosis) -> list[tuple[str, str, str]]:
    """Return (label, value, note) of the main numbers."""
    reduction = diagnosis.shrink
    before, after = words.number(reduction.before, 2), words.number(reduction.after, 2)
    changed = [c for c in diagnosis.causes if c.identifier in diagnosis.verdict]
    tiles = [
        ("residual", f"{before} → {after}" if changed else before, "times the noise, on held-out flights")
    ]
    if changed:
        note = f"95\u00a0% interval {words.percent_interval(reduction.ci95)}"
        closed = (
            words.percent(min(max(reduction.fraction, 0.0), 1.0)) if has_gap(reduction) else words.NOTHING
        )
        tiles.append(("of the gap closed", closed, note if has_gap(reduction) else "there was none to close"))
    first, last = reduction.replay_before, reduction.replay_after
    if first is not None:
        figure = words.number(first.position[-1, 0], 2)
        if changed and last is not None:
            figure += f" → {words.number(last.position[-1, 0], 2)}"
        tiles.append(("replay error [m]", figure, f"of position after {first.horizon[-1]:g} s, median"))
    if not diagnosis.cannot_tell:
        tiles.append(("something unknown", words.probability(diagnosis.unknown_probability), "probability"))
    return tiles


def _largest(channels: Sequence[ChannelGap]) -> str:
    """Return a sentence on the channel with the largest ratio of residual to noise."""
    known = [channel for channel in channels if channel.noise_floor > 0]
    if not known:
        return ""
    worst = max(known, key=lambda channel: channel.rms / channel.noise_floor)
    before, after = (words.number(size / worst.noise_floor, 2) for size in (worst.rms, worst.after))
    return f"The gap is largest in {worst.channel}: {before} times its noise before, {after} after."


def _channel_row(channel: ChannelGap) -> list[str]:
    figures = [words.number(v) for v in (channel.rms, channel.after, channel.noise_floor)]
    seen = channel.rms >= SEEN * channel.noise_floor
    return [channel.channel, channel.unit, *figures, words.percent(channel.explained) if seen else "–"]


def _judges(diagnosis: Diagnosis) -> list[tuple[str, str]]:
    """Return the held-out flights with the use of each."""
    halves = "first half: fit; second half: judge"
    return [(n, halves if n in diagnosis.joined else "judge (held out)") for n in diagnosis.held_out]


def _cause(cause: Cause, flights: int) -> dict[str, Any]:
    """Return the content of one cause's card."""
    rows = []
    for name, parameter in cause.parameters.items():
        value, bounds = words.estimate(parameter)
        rows.append((name, value, bounds, words.unit_of(parameter.unit) or "1"))
    begins = [words.onset(t, name) for name, t in cause.onset.items() if t is not None]
    acting = len(cause.onset) or flights
    always = acting - len(begins)
    onset = (
        ["from the start" if not begins else f"from the start in {always} of {acting} flights"]
        if always
        else []
    )
    return {
        "title": words.title_of(cause.identifier),
        "identifier": cause.identifier,
        "probability": words.probability(cause.probability),
        "share": words.percent(cause.share) if math.isfinite(cause.share) else "",
        "rows": rows,
        "onset": "; ".join([*begins, *onset]),
        "others": words.listed([words.name_of(other) for other in cause.indistinguishable_from], "or"),
    }


def _replay_rows(
    before: ReplayGap | None, after: ReplayGap | None
) -> list[tuple[str, list[tuple[str, str]]]]:
    """Return (horizon, cells): median and interval of position, velocity and attitude, each before and after."""
    gap = before or after
    rows = []
    for k, horizon in enumerate(gap.horizon if gap else ()):
        cells = []
        for name in ("position", "velocity", "attitude"):
            for figures in (before, after):
                cells.append(_with_interval([] if figures is None else getattr(figures, name)[k].tolist()))
        rows.append((f"{horizon:g}", cells))
    return rows


def _with_interval(figures: list[float]) -> tuple[str, str]:
    if not figures:
        return words.NOTHING, ""
    value, lower, upper = (words.number(figure, 2) for figure in figures)
    return value, f"{lower} … {upper}"


def _finding(finding: Finding) -> dict[str, str]:
    figures = [f"{name} {words.number(value)}" for name, value in finding.figures.items()]
    return {
        "title": words.title_of(finding.name),
        "text": finding.text,
        "size": words.percent(finding.size) if abs(finding.size) <= 1 else words.number(finding.size),
        "figures": ", ".join(figures),
    }
