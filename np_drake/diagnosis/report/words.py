"""Names, numbers and units as text for people."""

import math
import re
import string
from collections.abc import Sequence

from np_drake.diagnosis.result import UNKNOWN, Cause, Estimate, Finding
from np_drake.effects.base import Effect, departure
from np_drake.effects.library import effect_of
from np_drake.files.number_text import (
    NBSP,
    NOTHING,
    departure_unit,
    fixed,
    measure,
    number,
    percent,
    suited,
    with_unit,
)
from np_drake.files.number_text import UNITS as UNITS
from np_drake.files.number_text import probability as probability


def name_of(identifier: str) -> str:
    """Return the name of an effect with its article; of what is none, the words of its
    identifier.
    """
    if identifier == UNKNOWN:
        return "something unknown"
    effect = effect_of(identifier)
    return identifier.replace("_", " ") if effect is Effect else effect.title()


def bare_name(identifier: str) -> str:
    """Return the name of an effect without its article."""
    return name_of(identifier).removeprefix("a ").removeprefix("an ").removeprefix("the ")


def capital(text: str) -> str:
    """Return the text with a capital at its beginning."""
    return text[:1].upper() + text[1:]


def listed(names: Sequence[str], last: str = "and") -> str:
    """Join names as in 'x', 'x and y', 'x, y and z'."""
    return f" {last} ".join([", ".join(names[:-1]), names[-1]] if len(names) > 1 else names)


def flights(count: int) -> str:
    """Return 'the held-out flight' or 'the held-out flights'."""
    return f"the held-out flight{'s' * (count != 1)}"


def unit_of(cause: Cause, parameter: Estimate) -> str:
    """Return the unit of a parameter: shares for factors, '1' where it has none."""
    return (
        "share"
        if parameter.unit == "1" and effect_of(cause.identifier).shares
        else parameter.unit or "1"
    )


def estimate(parameter: Estimate, unit: str, *, brief: bool = False) -> tuple[str, str]:
    """Return value and 95 % interval as text, in a unit that suits them and with the digits that
    the interval tells.

    Args:
        unit: of the parameter, as `unit_of` gives it.
    """
    lower, upper = parameter.ci95
    half = 0.5 * (upper - lower)
    if half == 0 and parameter.unit in ("", "1") and parameter.value == round(parameter.value):
        return str(round(parameter.value)), NOTHING  # a choice, such as the number of a rotor
    if not (math.isfinite(half) and half > 0):
        return measure(parameter.value, unit), NOTHING
    largest = max(abs(parameter.value), abs(lower), abs(upper))
    factor, shown = suited(largest, unit)
    told = -math.floor(math.log10(0.5 * factor * half))
    if told > 6:
        return measure(
            parameter.value, unit, 3
        ), f"{number(factor * lower)} to {number(factor * upper)}"
    three = 2 - math.floor(math.log10(factor * largest))
    decimals = max(min(told, three) if brief or 10.0**-three <= factor * half else told, 0)
    value, low, high = (fixed(factor * v, decimals) for v in (parameter.value, lower, upper))
    return with_unit(value, shown), f"{low} to {high}"


def phrase(cause: Cause) -> str:
    """Return a cause with its size in few words, as in 'a 4.8 g payload on 0.52 m'."""
    name, parameters = name_of(cause.identifier), cause.parameters
    values = {n: estimate(p, unit_of(cause, p), brief=True)[0] for n, p in parameters.items()}
    (unit, *others) = {p.unit for p in parameters.values()} or {""}
    own = effect_of(cause.identifier).phrase
    if own and {field for _, field, _, _ in string.Formatter().parse(own) if field} <= set(values):
        return own.format(**values)
    if len(values) == 1:
        return f"{name} of {next(iter(values.values()))}"
    if others or unit in ("", "1"):
        return name
    sizes = [p.value for p in parameters.values()]
    if set(parameters) == set("xyz") or "roll" in parameters:
        return f"{name} of {measure(math.hypot(*sizes), unit)}"
    return f"{name} of up to {measure(max(sizes, key=abs), unit)}"


def changed(cause: Cause) -> str:
    """Return what changed, with its 95 % interval where it is one number."""
    effect = effect_of(cause.identifier)
    free = [p for p in effect.parameters if not p.choices]
    if cause.effect is None or len(free) != 1 or not free[0].departure:
        return phrase(cause)
    p, one = free[0], cause.parameters[free[0].name]
    others = {n: v for n, v in cause.effect.values.items() if n != p.name}
    unit, text = departure(p, one.value - p.neutral, others, shares=effect.shares)
    factor, shown = departure_unit(unit)
    low, high = (measure(factor * (end - p.neutral), shown) for end in one.ci95)
    return f"{text} ({low} to {high})"


def described(finding: Finding) -> str:
    """Return what a finding says, with the figures that its text leaves out."""
    text, figures, more = finding.text.rstrip("."), finding.figures, []
    if "frequency" in figures and "Hz" not in text:
        more.append(f"near {measure(figures['frequency'], 'Hz')}")
    if "time" in figures and " s" not in text:
        more.append(f"at {figures['time']:.1f}{NBSP}s")
    if "share" in figures:
        more.append(f"{percent(figures['share'])} of weight")
    elif figures.get("force") and not re.search(rf"\d[ {NBSP}][mµ]?N\b", text):
        more.append(f"{measure(figures['force'], 'N')} RMS")
    elif figures.get("torque"):
        more.append(f"{measure(figures['torque'], 'N·m')} RMS")
    return ", ".join([text, *more])


def onset(time: float, flight: str) -> str:
    """Return when an effect begins in a flight, at `time` [s]; infinite: absent.

    Args:
        time: [s].
    """
    return f"{flight}: {time:.1f}{NBSP}s" if math.isfinite(time) else f"{flight}: not at all"


def plain_name(name: str, longest: int = 36) -> str:
    """Return a file name for a figure, with characters that fonts lack replaced, and shortened to
    `longest`.
    """
    shown = "".join(sign if sign.isprintable() and ord(sign) < 0x250 else "?" for sign in name)
    return shown if len(shown) <= longest else f"{shown[: longest - 10]}…{shown[-9:]}"
