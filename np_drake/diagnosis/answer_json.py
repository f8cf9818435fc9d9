"""A diagnosis as `diagnosis.json` (docs/reference/files.md): dictionaries, lists, strings and finite numbers."""

import dataclasses as dc
from collections.abc import Iterable
from typing import Any

from np_drake.atomic_file import plain
from np_drake.diagnosis.answer import Cause, Diagnosis, ReplayGap, Where

SCHEMA = "np_drake.diagnosis/1"


def as_json(diagnosis: Diagnosis) -> dict[str, Any]:
    """All of it but the traces and the fitted objects; what is not finite is None."""
    check, shrink = diagnosis.check, diagnosis.shrink
    content = {
        "schema": SCHEMA,
        "vehicle": diagnosis.vehicle,
        "train": diagnosis.train,
        "held_out": diagnosis.held_out,
        "joined": diagnosis.joined,
        "judged_as": diagnosis.judged_as,
        "verdict": diagnosis.verdict,
        "cannot_tell": diagnosis.cannot_tell,
        "unknown_probability": diagnosis.unknown_probability,
        "causes": [_cause(cause) for cause in diagnosis.causes],
        "gap": _gap(diagnosis.where, shrink.replay_before),
        "shrink": {
            "residual": {
                name: getattr(shrink, name) for name in ("before", "after", "floor", "fraction", "ci95")
            },
            "replay": _both_replays(shrink.replay_before, shrink.replay_after),
            "ladder": _dictionaries(shrink.ladder),
        },
        "not_identifiable": _dictionaries(check.not_identifiable),
        "minor": _dictionaries(diagnosis.minor),
        "remains": _dictionaries(diagnosis.remains),
        "check": {name: getattr(check, name) for name in ("usable", "excitation", "noise_floor", "warnings")},
        "warnings": diagnosis.warnings,
        "wall": diagnosis.wall,
    }
    return plain(content)


def _cause(cause: Cause) -> dict[str, Any]:
    return {
        "effect": cause.identifier,
        "probability": cause.probability,
        "share": cause.share,
        "parameters": {name: dc.asdict(estimate) for name, estimate in cause.parameters.items()},
        "onset": cause.onset,
        "absent_from": [flight for flight, time in cause.onset.items() if time == float("inf")],
        "indistinguishable_from": cause.indistinguishable_from,
    }


def _gap(where: Where, replay: ReplayGap | None) -> dict[str, Any]:
    """By kind and axis; the replay's medians; and where in time, regime and frequency."""
    gap: dict[str, Any] = {"force": {}, "torque": {}}
    for channel in where.channels:
        kind, axis = channel.channel.split()
        figures = {
            name: getattr(channel, name) for name in ("unit", "rms", "noise_floor", "after", "explained")
        }
        gap.setdefault(kind, {})[axis] = figures
    gap["replay"] = None if replay is None else {"horizon": replay.horizon, **_medians(replay)}
    for name in ("segments", "regimes", "bands"):
        gap[name] = _dictionaries(getattr(where, name))
    return gap


def _both_replays(before: ReplayGap | None, after: ReplayGap | None) -> dict[str, Any] | None:
    """Medians and their 95 % intervals, nominal and with the causes added."""
    known = before or after
    if known is None:
        return None
    both = {"before": before, "after": after}
    figures = {
        name: None if gap is None else {**_medians(gap), **_intervals(gap)} for name, gap in both.items()
    }
    return {"horizon": known.horizon, "starts": known.starts, **figures}


def _medians(gap: ReplayGap) -> dict[str, list[float]]:
    """(h,) each [m], [m/s], [deg]."""
    return {name: values[:, 0].tolist() for name, values in _quantities(gap)}


def _intervals(gap: ReplayGap) -> dict[str, list[list[float]]]:
    """(h, 2) each."""
    return {f"{name}_ci95": values[:, 1:].tolist() for name, values in _quantities(gap)}


def _quantities(gap: ReplayGap) -> Iterable[tuple[str, Any]]:
    return (("position", gap.position), ("velocity", gap.velocity), ("attitude_deg", gap.attitude))


def _dictionaries(items: Iterable[Any]) -> list[dict[str, Any]]:
    return [{field.name: getattr(item, field.name) for field in dc.fields(item)} for item in items]
