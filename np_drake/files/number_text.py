"""Numbers and units as text, alike on the screen, in reports and in tables."""

import math
import re
import sys
from collections.abc import Container, Iterable

NOTHING = "–"
NBSP = "\u00a0"  # a number and its unit stay on one line
_UNIT = re.compile(
    r"(?<=[\d.]) (?=(?:%|[cmµk]?(?:N|m|s|g|V|A|rad|Hz)|deg|nat)(?:[·/²³]\S*)?(?:[\s,;:.)]|$))"
)
_NUMBER = re.compile(r"(?<![\w.])\d+(?:\.\d+)?")  # none that is part of a name
_RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")

# units with the prefixes m and µ
_THOUSANDTHS = {"N", "N·m", "N·s/m", "N·m·s/m", "N·s²/m²", "s", "rad/s"}
UNITS = {  # SI unit: (from this size on [SI], factor, unit shown), the largest first
    "kg": ((1.0, 1.0, "kg"), (0.0, 1e3, "g")),
    "m": ((0.1, 1.0, "m"), (0.0, 1e2, "cm")),
    "rad": ((0.02, math.degrees(1.0), "°"), (0.0, 1e3, "mrad")),
    "m/s": ((0.1, 1.0, "m/s"), (0.0, 1e2, "cm/s")),
    "kg·m²": ((0.0, 1e4, "kg·cm²"),),
    "1/s": ((0.0, 1e2, "%/s"),),
    "deg": ((0.0, 1.0, "°"),),
    "1": ((0.0, 1.0, ""),),
    "share": ((0.0, 1e2, "%"),),
    **{u: ((0.1, 1.0, u), (1e-4, 1e3, f"m{u}"), (0.0, 1e6, f"µ{u}")) for u in _THOUSANDTHS},
}

_DEPARTURES = {  # SI unit: (factor, unit shown) of a small departure
    "rad": (math.degrees(1.0), "deg"),
    "rad/s": (math.degrees(1.0), "°/s"),
    "m": (1e3, "mm"),
    "1/s": (60.0, "share"),
}


def grouped(lines: Iterable[str], names: Container[str]) -> list[str]:
    """Return every line once: what is said of several names stands behind them all, and lines that
    differ in numbers alone are one, with the numbers of each.

    Args:
        lines: "name: text", or text of none of the names.
    """
    alike: dict[str, tuple[dict[str, None], dict[str, None]]] = {}
    for line in lines:
        name, _, text = line.partition(": ")
        remark = text if name in names else line
        of, texts = alike.setdefault(_NUMBER.sub("\0", remark), ({}, {}))
        of |= {name: None} if name in names else {}
        texts[remark] = None
    result = []
    for of, texts in alike.values():
        each = zip(*map(_NUMBER.findall, texts), strict=True)
        values = [*(" / ".join(dict.fromkeys(numbers)) for numbers in each), ""]
        parts = zip(_NUMBER.split(next(iter(texts))), values, strict=True)
        text = "".join(part + value for part, value in parts)
        result.append(f"{', '.join(of)}: {text}" if of else text)
    return result


def departure_unit(unit: str) -> tuple[float, str]:
    """Return the factor and the unit in which a small departure [SI unit] is read: degrees, mm,
    share in a minute.
    """
    return _DEPARTURES.get(unit, (1.0, unit))


def number(value: float | None, digits: int = 3) -> str:
    """Return a number with significant digits, or with a power of ten where that is shorter; a dash
    if not finite.

    Args:
        value: to write; None: a dash.
    """
    if value is None or not math.isfinite(value):
        return NOTHING
    if abs(value) < sys.float_info.min:
        return "0"
    power = math.floor(math.log10(abs(float(f"{value:.{digits - 1}e}"))))  # of the rounded value
    if -4 <= power < 5:
        return fixed(value, max(digits - 1 - power, 0))
    return f"{fixed(value / 10.0**power, digits - 1)} × 10{str(power).translate(_RAISED)}"


def fixed(value: float, decimals: int) -> str:
    """Return a number with these decimals, a true minus, and no minus before zero."""
    text = f"{value:.{decimals}f}"
    return text.lstrip("-") if float(text) == 0 else text.replace("-", "−")


def with_unit(text: str, unit: str) -> str:
    """Return a number with its unit behind it, on one line; the unit 1 is not written."""
    return f"{text}{'' if unit in ('', '1', '°') else NBSP}{'' if unit == '1' else unit}"


def percent(share: float | None) -> str:
    """Return a share in per cent.

    Near 0 % and 100 % it has a decimal, and a share between the two is never shown as 0 % or 100 %.
    """
    if share is None or not math.isfinite(share):
        return NOTHING
    if 0.9995 <= share < 1:
        return f">{NBSP}99.9{NBSP}%"
    if 0 < share < 0.001:
        return f"<{NBSP}0.1{NBSP}%"
    near = 0 < share < 0.0095 or 0.985 < share < 1
    return f"{fixed(100 * share, 1 if near else 0)}{NBSP}%"


def probability(value: float) -> str:
    """Return a probability in per cent, never 0 % or 100 %."""
    return percent(min(max(value, 1e-9), 1 - 1e-9)) if math.isfinite(value) else NOTHING


def of_at_least(value: float) -> str:
    """Return a least probability as text behind 'a probability': 'of 98 % or more', or 'above 99.9
    %'.
    """
    text = probability(value)
    return f"above {text[2:]}" if text.startswith(">") else f"of {text} or more"


def kept_together(text: str) -> str:
    """Return a text in which no line breaks between a number and its unit."""
    return _UNIT.sub(NBSP, text)


def measure(value: float | None, unit: str, digits: int = 2) -> str:
    """Return a size [SI unit] in the unit that suits it, as in '35 g', '48 cm', '2.1 m/s'.

    Args:
        value: size in SI units; None: a dash.
    """
    if value is None or not math.isfinite(value):
        return NOTHING
    factor, shown = suited(abs(value), unit)
    return with_unit(number(factor * value, digits), shown)


def suited(size: float, unit: str) -> tuple[float, str]:
    """Return the factor and the name of the unit in which a size [SI unit] is read best."""
    steps = UNITS.get(unit, ((0.0, 1.0, unit),))
    return next((factor, shown) for least, factor, shown in steps if size >= least)
