"""Content of the sheet beside an imported log: what was mapped, turned, aligned and left out, in
words for people.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from np_drake.effects.accelerometer_bias import AccelerometerBias
from np_drake.effects.gyro_bias import GyroBias
from np_drake.effects.library import unobservable
from np_drake.flight_log import FlightLog
from np_drake.logs.importing.consistency import SCALE, failing
from np_drake.logs.importing.conventions import Verdict, as_text
from np_drake.logs.importing.interpolation import Signal
from np_drake.logs.importing.log_map import UNITS, LogMap
from np_drake.logs.importing.part import Part


def sheet_content(
    path: str | Path,
    title: str,
    facts: Mapping[str, str],
    log_map: LogMap,
    parts: Sequence[Part],
    flights: Sequence[FlightLog],
    notes: Sequence[str],
) -> dict[str, Any]:
    """Return the content of the sheet of one log.

    Args:
        notes: what was derived, mended or left out, one line each.
    """
    longest = max(parts, key=lambda part: len(part.aligned.t))
    spans = ", ".join(f"{log.name}: {len(log)} rows, {log.t[-1]:.4g} s" for log in flights)
    return {
        "source": Path(path).name,
        "format": title,
        **({"facts": dict(facts)} if facts else {}),
        "frames": (
            f"world {log_map.world}, body {log_map.body}; written as z up and z along the thrust"
        ),
        "columns": {
            n: _described(n, own, log_map)
            for n, own in longest.signals.items()
            if getattr(log_map, n)
        },
        "conventions": _conventions_text(longest.verdict),
        "rows": f"{1 / flights[0].step:.4g} Hz; {spans}",
        "input": flights[0].input,
        "command": log_map.command,
        "gaps": _gaps_text(parts, flights),
        "notes": [
            *notes,
            *(note for part in parts for note in (*part.aligned.notes, *ground_notes(part))),
        ],
        "cannot_be_told": unanswerable(flights[0]),
    }


def unanswerable(log: FlightLog) -> dict[str, list[str]]:
    """Return the effects that this kind of log cannot tell, by reason."""
    each_rotor = log.throttle is not None and log.throttle.shape[1] == 4
    torque = log.input in ("command", "rotor_speed") or (log.input == "normalised" and each_rotor)
    found: dict[str, list[str]] = {}
    for identifier, reason in unobservable(
        log.input, accelerations=log.a is not None, torque=torque, lacks=log.lacks
    ).items():
        found.setdefault(reason, []).append(identifier)
    return found


def _described(name: str, signal: Signal, log_map: LogMap) -> dict[str, Any]:
    source = getattr(log_map, name)
    keys = ["scale", "signs", "axes", "kind", "late"]
    if name == "attitude" and len(source.columns) == 4:
        keys += ["order", "direction"]
    usual: dict[str, Any] = {"scale": 1.0, "signs": [], "late": 0.0}
    shown = {
        key: getattr(source, key)
        for key in keys
        if getattr(source, key) not in ("", None, usual.get(key))
    }
    unit = source.unit or next(iter(UNITS[name]))
    return {
        "from": list(source.columns),
        "rate": f"{1 / signal.step:.4g} Hz",
        "unit": unit,
        **shown,
    }


def _conventions_text(verdict: Verdict) -> str:
    if not verdict.misfits:
        return "not checked: no flight, too short, or no two quantities that can be compared"
    count, wrong = len(verdict.misfits), failing(verdict.misfits)
    worst = max(verdict.misfits, key=lambda law: verdict.misfits[law])
    text = (
        f"agree with the log in {count} checks (worst misfit {verdict.misfits[worst]:.2g}, {worst})"
    )
    if wrong:
        laws = ", ".join(f"{law} {verdict.misfits[law]:.2g}" for law in wrong)
        text = (
            f"hold in {count - len(wrong)} of {count} checks; misfit of {laws} ({SCALE}): "
            f"{_why(wrong)}"
        )
    return text + (f"; adopted: {as_text(verdict.changes)}" if verdict.changes else "")


def _why(laws: Sequence[str]) -> str:
    """Return what may act where these laws fail, though no other convention makes them hold."""
    reasons = {
        "attitude": (
            f"body rates drift or have a bias about that axis ({GyroBias.identifier} can be told)"
        ),
        "velocity": (
            f"the acceleration drifts along that axis ({AccelerometerBias.identifier} can be told)"
        ),
        "position": "position or velocity drifts along that axis",
        "lift": (
            "a force that is neither thrust nor drag acts across the thrust axis, or the "
            "attitude is wrong"
        ),
    }
    kinds = dict.fromkeys(law.split()[0] for law in laws)
    return "; ".join(reasons[kind] for kind in kinds if kind in reasons)


def _gaps_text(parts: Sequence[Part], flights: Sequence[FlightLog]) -> str:
    filled = sum(int((part.aligned.filled & ~part.ground).sum()) for part in parts)
    longest = max(np.diff(log.t).max() for log in flights)
    text = f"{filled} rows inside gaps left out" if filled else "none"
    if filled or len(flights) > 1 or longest >= 2.5 * flights[0].step:
        text += f"; longest gap in a part {longest:.3g} s"
    return text + (f"; split into {len(flights)} parts" if len(flights) > 1 else "")


def ground_notes(part: Part) -> list[str]:
    """Return one line on the time on the ground that is left out of a part, or none."""
    t, ground = part.aligned.t, part.ground
    air = np.flatnonzero(~ground)
    if not len(air):
        return []
    between = float(ground[air[0] : air[-1]].sum() * np.median(np.diff(t)))
    spans = {"before": t[air[0]] - t[0], "after": t[-1] - t[air[-1]], "between flights": between}
    told = [f"{span:.3g} s {when}" for when, span in spans.items() if span > 0]
    return [f"on the ground: {', '.join(told)} left out"] if told else []
