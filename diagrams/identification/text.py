"""Identified quantities as text: values with 95 % intervals, and what flights do not tell with what
would.
"""

import math
from collections.abc import Sequence

import numpy as np

from np_drake.diagnosis.report.words import (
    UNITS,
    capital,
    estimate,
    flights,
    listed,
    number,
    suited,
)
from np_drake.diagnosis.result import Estimate
from np_drake.files.number_text import percent
from np_drake.identification.flight_agreement import DIFFER, FlightValues, flight_values, own_values
from np_drake.identification.identify import Identification
from np_drake.identification.quantities import Identified
from np_drake.identification.validation import HeldOut

# (factor, unit) in which a vehicle's lengths and small angles are read best; a drag is no share.
SHOWN = {
    "m": (1e3, "mm"),
    "m/s": (1e3, "mm/s"),
    "rad": (float(np.degrees(1.0)), "°"),
    "1/s": (1.0, "s⁻¹"),
}
LEADING = (
    *("mass", "thrust coefficient", "thrust at full throttle"),
    *("inertia xx", "inertia yy", "inertia zz", "time constant up", "transport delay"),
)
RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
KINDS = {
    "rotor_speed": "measured rotor speed",
    "throttle": "throttle of each motor",
    "command": "thrust and torque",
}


def interval(q: Identified) -> tuple[str, str]:
    """Return value and 95 % interval of a quantity as text, with the digits that the interval
    tells.
    """
    factor, unit = shown_in(q)
    return estimate(Estimate(factor * q.value, unit, (factor * q.low, factor * q.high)), unit)


def prior_interval(q: Identified) -> str:
    """Return the 95 % interval of the prior as text, in the unit of the value."""
    factor, unit = shown_in(q)
    low, high = factor * q.prior[0], factor * q.prior[1]
    return estimate(Estimate(0.5 * (low + high), unit, (low, high)), unit, brief=True)[1]


def shown_in(q: Identified) -> tuple[float, str]:
    """Return the factor and the name of the unit in which a quantity is shown."""
    unit, largest = q.quantity.unit, max(abs(q.value), abs(q.low), abs(q.high))
    if unit in SHOWN:
        return SHOWN[unit]
    power = math.floor(math.log10(largest)) if largest > 0 else 0
    if (unit == "kg·m²" and -3 <= power <= -2) or (unit not in UNITS and power < -2):
        return 10.0**-power, f"× 10{str(power).translate(RAISED)} {unit}"
    return suited(largest, unit)


def half_width(q: Identified, low: float, high: float) -> str:
    """Return half of an interval: relative where a quantity is positive, else in the unit of its
    value.
    """
    if not q.quantity.positive:
        return f"± {number(0.5 * shown_in(q)[0] * (high - low), 2)}"
    ratio = float((high / low) ** 0.5)
    return f"± {100 * (ratio - 1):.2g} %" if ratio < 1.5 else f"× ÷ {ratio:.2g}"


def not_told(found: Identification) -> list[tuple[str, list[str], str]]:
    """Return (manoeuvre, names, why) of what the flights do not tell, a manoeuvre each that would
    tell it.
    """
    ways: dict[str, list[Identified]] = {}
    for q in found.quantities:
        if not q.told and q.quantity.manoeuvre:
            ways.setdefault(q.quantity.manoeuvre, []).append(q)
    return [
        (
            way,
            [q.name for q in names],
            "; ".join(dict.fromkeys(q.quantity.why for q in names if q.quantity.why)),
        )
        for way, names in ways.items()
    ]


def summary(found: Identification) -> list[str]:
    """Return what a reader must know, a sentence each."""
    lines = [headline(found)]
    lines += [
        f"not told: {', '.join(names)}; {way} would tell" for way, names, _ in not_told(found)
    ]
    silent = (q.name for q in found.quantities if not q.told and not q.quantity.manoeuvre)
    lines += [f"not told: {name}" for name in silent]
    if differing := differences([*own_values(found), *flight_values(found)]):
        lines += [*differing, "where flights differ, intervals hold the spread between them"]
    return lines


def differences(each: Sequence[FlightValues]) -> list[str]:
    """Return what flights differ in: a sentence for what stands out or moves with something, one
    for all else.
    """
    differing = [told for told in each if told.differ]
    plain = [told.quantity.name for told in differing if not told.apart]
    alone = [told.text for told in differing if told.quantity.name not in plain]
    return [f"flights differ in: {'; '.join(plain)}", *alone] if plain else alone


def agreement(q: Identified) -> str:
    """Return whether flights agree on a quantity; empty where that was not tested."""
    if q.p != q.p:
        return ""
    return "agree" if q.p >= DIFFER else f"differ, p {q.p:.1g}"


def headline(found: Identification) -> str:
    """Return the answer in one line."""
    told, every = sum(q.told for q in found.quantities), len(found.quantities)
    count = len(found.models)
    by = f"{count} flight{'s' * (count > 1)}"
    of = found.prior.name
    if not told:
        return f"{by} of {of}: the prior tells as much"
    return f"{by} tell{'s' * (count == 1)} {told} of {every} quantities of {of}"


def lead(found: Identification, rows: Sequence[HeldOut]) -> str:
    """Return the leading values, and how the held-out residual changes."""
    known = {q.name: q for q in found.quantities if q.told and q.quantity.positive}
    values = [
        f"{q.name} {interval(q)[0]} ({half_width(q, q.low, q.high)})"
        for q in (known[name] for name in LEADING if name in known)
    ]
    said = [f"{capital(listed(values))}."] if values else []
    return " ".join([*said, *filter(None, [change(rows)])])


def change(rows: Sequence[HeldOut]) -> str:
    """Return how far the residual of held-out flights changes from the vehicle file to the
    identified one.
    """
    names = list(dict.fromkeys(row.flight for row in rows))
    both = []
    for kind in ("force", "torque"):
        before, after = (
            float(np.sqrt(np.sum([np.square(getattr(r, kind)) for r in rows if r.model == model])))
            for model in ("vehicle file", "identified")
        )
        if before > 0:
            fall = 1.0 - after / before
            both.append(f"{kind} {'falls' if fall >= 0 else 'rises'} by {percent(abs(fall))}")
    return f"On {flights(len(names))} the residual {listed(both)}." if both else ""
