"""Identified quantities as text: values with 95 % intervals, and what flights do not tell with what
would.
"""

import math
from collections.abc import Sequence

import numpy as np

from np_drake.diagnosis.report.words import estimate, flights, listed
from np_drake.diagnosis.result import Estimate
from np_drake.files.number_text import UNITS, number, percent, suited
from np_drake.identification.flight_agreement import DIFFER, FlightValues, flight_values, own_values
from np_drake.identification.identify import Identification
from np_drake.identification.quantities import Identified
from np_drake.identification.validation import HeldOut

RATIOS = (
    "the mass is not known, so that all values are over it (kg counts as 1); give --mass "
    "for a vehicle file"
)
# (factor, unit) in which a vehicle's lengths and small angles are read best; a drag is no share.
SHOWN = {
    "m": (1e3, "mm"),
    "m/s": (1e3, "mm/s"),
    "rad": (float(np.degrees(1.0)), "°"),
    "1/s": (1.0, "s⁻¹"),
}
RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
KINDS = {
    "rotor_speed": "measured rotor speed",
    "throttle": "throttle of each motor",
    "command": "thrust and torque",
}


def unit_of(found: Identification, q: Identified) -> str:
    """Return the unit of a quantity, over the mass where only ratios are told."""
    return (
        f"{q.quantity.unit}/kg" if found.basis.ratios and q.quantity.per_mass else q.quantity.unit
    )


def interval(found: Identification, q: Identified) -> tuple[str, str]:
    """Return value and 95 % interval of a quantity as text, with the digits that the interval
    tells.
    """
    return _text(shown_in(found, q), q.value, q.low, q.high)


def prior_interval(found: Identification, q: Identified) -> str:
    """Return the 95 % interval of the prior as text, in the unit of the value."""
    low, high = q.prior
    return _text(shown_in(found, q), 0.5 * (low + high), low, high, brief=True)[1]


def shown_in(found: Identification, q: Identified) -> tuple[float, str]:
    """Return the factor and the name of the unit in which a quantity is shown."""
    unit, largest = unit_of(found, q), max(abs(q.value), abs(q.low), abs(q.high))
    if unit in SHOWN:
        return SHOWN[unit]
    power = math.floor(math.log10(largest)) if largest > 0 else 0
    if (unit == "kg·m²" and -3 <= power <= -2) or (unit not in UNITS and power < -2):
        return 10.0**-power, f"× 10{str(power).translate(RAISED)} {unit}"
    return suited(largest, unit)


def _text(
    shown: tuple[float, str], value: float, low: float, high: float, *, brief: bool = False
) -> tuple[str, str]:
    factor, unit = shown
    return estimate(
        Estimate(factor * value, unit, (factor * low, factor * high)), unit, brief=brief
    )


def half_width(found: Identification, q: Identified, low: float, high: float) -> str:
    """Return half of an interval: relative where a quantity is positive, else in the unit of its
    value.
    """
    if not q.quantity.positive:
        return f"± {number(0.5 * shown_in(found, q)[0] * (high - low), 2)}"
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
    lines += [
        f"not told: {q.name}" for q in found.quantities if not q.told and not q.quantity.manoeuvre
    ]
    if differing := differences([*own_values(found), *flight_values(found)]):
        lines += [*differing, "where flights differ, intervals hold the spread between them"]
    if found.basis.ratios:
        lines.append(RATIOS)
    return lines


def differences(each: Sequence[FlightValues]) -> list[str]:
    """Return what flights differ in: a sentence for what stands out, one for all else."""
    differing = [told for told in each if told.differ]
    plain = [told.quantity.name for told in differing if not told.apart]
    return [
        *([f"flights differ in: {'; '.join(plain)}"] if plain else []),
        *(told.text for told in differing if told.quantity.name not in plain),
    ]


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
    of = "a vehicle over its mass" if found.basis.ratios else found.prior.name
    if not told:
        return f"{by} of {of}: the prior tells as much"
    return f"{by} tell{'s' * (count == 1)} {told} of {every} quantities of {of}"


def lead(found: Identification, rows: Sequence[HeldOut]) -> str:
    """Return the leading values, and how the held-out residual changes."""
    leading = (
        "mass",
        "thrust coefficient",
        "thrust at full throttle",
        "inertia xx",
        "inertia yy",
        "inertia zz",
        "time constant up",
        "transport delay",
    )
    known = {q.name: q for q in found.quantities if q.told}
    first = [known[name] for name in leading if name in known and known[name].quantity.positive]
    values = [
        f"{q.name} {interval(found, q)[0]} ({half_width(found, q, q.low, q.high)})" for q in first
    ]
    said = [f"{listed(values)}."] if values else []
    said[:1] = [said[0][:1].upper() + said[0][1:]] if said else []
    if text := change(rows):
        said.append(text)
    return " ".join(said)


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
