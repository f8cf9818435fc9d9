"""What is shown of an identification: sentences, figures, and the page of what the flights tell of
a vehicle, how sure, and how well it predicts another flight.
"""

import math
from collections.abc import Sequence
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

from np_drake.diagnosis.report.diagnosis_page import PLAIN_TICKS, legend
from np_drake.diagnosis.report.words import (
    capital,
    estimate,
    flights,
    listed,
    measure,
    number,
    plain_name,
    suited,
)
from np_drake.diagnosis.result import Estimate
from np_drake.files import page
from np_drake.files.figure_file import PALETTE, Figure, new_figure
from np_drake.files.file_access import require_writable
from np_drake.files.number_text import NOTHING, UNITS, fixed, percent
from np_drake.files.page import Section
from np_drake.identification.flight_agreement import DIFFER, FlightValues, flight_values, own_values
from np_drake.identification.identify import Identification, doubts, trades
from np_drake.identification.quantities import QUANTITIES, Identified
from np_drake.identification.validation import ERRORS, HORIZONS, HeldOutErrors

PAGE = "identification.html"
TEMPLATE = Path(__file__).with_suffix(".html.j2")
VEHICLE = "vehicle.yaml"


def write_page(
    identification: Identification,
    rows: list[HeldOutErrors],
    folder: Path,
    *,
    thirds: bool = False,
    warnings: Sequence[str] = (),
) -> Path:
    """Write `identification.html` and its figures to a folder, and return the path of the page.

    Args:
        thirds: whether the last third of the flight was held out, not other flights.
    Raises: OSError: if the folder cannot be written.
    """
    require_writable(folder / PAGE)
    each = sorted(
        [*own_values(identification), *flight_values(identification)],
        key=lambda values: not values.differ,
    )
    pictures = {
        "intervals": interval_figure(identification),
        "agreement": agreement_figure(identification, each) if each else None,
        "residuals": residual_figure(rows) if rows else None,
    }
    shown = {
        **content(identification, rows, each),
        "thirds": thirds,
        "warnings": [*traded(identification), *doubts(identification), *warnings],
    }
    return page.write_page(
        folder / PAGE,
        f"Identification · {identification.prior.name}",
        [Section(TEMPLATE, shown)],
        pictures,
    )


def content(
    identification: Identification, rows: Sequence[HeldOutErrors], each: Sequence[FlightValues]
) -> dict[str, Any]:
    """Return the values that the template uses, with numbers formatted as text."""
    return {
        "vehicle": identification.prior.name,
        "headline": headline(identification),
        "lead": change(rows),
        "file": VEHICLE,
        "not_told": [
            (capital(listed(titles(identification, names))), why, way)
            for way, names, why in not_told(identification)
        ],
        "quantities": [
            [
                q.title,
                *interval(q),
                prior_interval(q),
                "flights" if q.observable else "prior",
                *([agreement(q)] if each else []),
            ]
            for q in identification.quantities
        ],
        "agreeing": [values.quantity.title for values in each if not values.differ],
        "differing": [f"{capital(sentence)}." for sentence in differences(each)],
        "numbers": ", ".join(
            f"{i + 1} {plain_name(model.flight.name)}"
            for i, model in enumerate(identification.models)
        ),
        "residuals": [_residual(row) for row in rows],
        "errors": [f"{name}, {h:g} s" for h in HORIZONS for name in ERRORS],
        "open_loop": [_open_loop(row) for row in rows if np.isfinite(row.open_loop).any()],
        "flights": [
            *((model.flight.name, "fitted") for model in identification.models),
            *((name, "held out") for name in dict.fromkeys(row.flight for row in rows)),
        ],
        "facts": [
            ("rotors driven by", KINDS[identification.basis.drive]),
            ("geometry of", identification.prior.name),
            ("mass", _mass(identification)),
            ("np_drake", version("np_drake")),
        ],
    }


def _residual(row: HeldOutErrors) -> list[str]:
    both = zip((row.force, row.torque), ("N", "N·m"), strict=True)
    sizes = [measure(v, unit) for values, unit in both for v in values]
    return [row.flight, row.model, *sizes]


def _open_loop(row: HeldOutErrors) -> list[str]:
    cells = [row.flight, row.model]
    for errors in row.open_loop:
        *sizes, turned, rates = errors
        cells += [measure(size, unit) for size, unit in zip(sizes, ("m", "m/s"), strict=True)]
        cells.append(f"{fixed(np.degrees(turned), 1)}°" if np.isfinite(turned) else NOTHING)
        cells.append(measure(rates, "rad/s"))
    return cells


def _mass(identification: Identification) -> str:
    """Return where the mass comes from."""
    basis = identification.basis
    if basis.mass is not None:
        return f"{measure(basis.mass, 'kg', 3)}, given"
    if basis.newtons:
        return "from commanded thrust, which counts as right"
    return "from the thrust coefficient of the file, which counts as right"


# (factor, unit) in which a vehicle's lengths and small angles are read best; a drag is no share.
SHOWN = {
    "m": (1e3, "mm"),
    "m/s": (1e3, "mm/s"),
    "rad": (math.degrees(1.0), "°"),
    "1/s": (1.0, "s⁻¹"),
}
EACH_ROTOR = "rotor speed, or the throttle of each motor, in the log"
TELLS = ("not told", "told")
ANSWERS = (  # first of each that a log can tell: thrust, turning, motors
    ("mass", "thrust coefficient", "thrust at full throttle", "hover command"),
    ("inertia xx", "thrust over command at hover, in weights"),
    ("time constant up", "torque over thrust", "drag, lateral"),
)
RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
KINDS = {
    "rotor_speed": "measured rotor speed",
    "throttle": "throttle of each motor",
    "command": "thrust and torque",
    "collective": "collective throttle",
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
    low = factor * q.prior[0]
    high = factor * q.prior[1]
    return estimate(Estimate(0.5 * (low + high), unit, (low, high)), unit, brief=True)[1]


def shown_in(q: Identified) -> tuple[float, str]:
    """Return the factor and the name of the unit in which a quantity is shown."""
    unit = q.quantity.unit
    largest = max(abs(q.value), abs(q.low), abs(q.high))
    if unit in SHOWN:
        return SHOWN[unit]
    power = math.floor(math.log10(largest)) if largest > 0 else 0
    if unit not in UNITS and power < -2:
        return 10.0**-power, f"× 10{str(power).translate(RAISED)} {unit}"
    return suited(largest, unit)


def half_width(q: Identified, low: float, high: float) -> str:
    """Return half of an interval: relative where a quantity is positive, else in the unit of its
    value.
    """
    if not q.quantity.positive:
        return f"± {number(0.5 * shown_in(q)[0] * (high - low), 2)}"
    ratio = (high / low) ** 0.5
    return f"± {100 * (ratio - 1):.2g} %" if ratio < 1.5 else f"× ÷ {ratio:.2g}"


def not_told(identification: Identification) -> list[tuple[str, list[str], str]]:
    """Return (manoeuvre, names, why) of what the flights do not tell, a manoeuvre each that would
    tell it.
    """
    traded = {name for pair in trades(identification) for names in pair for name in names}
    ways: dict[str, list[Identified]] = {}
    for q in identification.quantities:
        if not q.observable and q.quantity.manoeuvre and q.name not in traded:
            ways.setdefault(q.quantity.manoeuvre, []).append(q)
    silent = [
        q.name for q in QUANTITIES if not identification.parts.issuperset({*q.needs} & {"rotors"})
    ]
    alone = [(EACH_ROTOR, silent, "the log does not say what turns each rotor")] if silent else []
    return alone + [
        (
            way,
            [q.name for q in names],
            "; ".join(dict.fromkeys(q.quantity.why for q in names if q.quantity.why)),
        )
        for way, names in ways.items()
    ]


def summary(identification: Identification) -> list[str]:
    """Return what a reader must know, a sentence each."""
    lines = [
        headline(identification),
        *(
            f"not told: {', '.join(titles(identification, names))}; {way} would tell"
            for way, names, _ in not_told(identification)
        ),
        *traded(identification),
        *(
            f"not told: {q.title}"
            for q in identification.quantities
            if not q.observable and not q.quantity.manoeuvre
        ),
    ]
    if differing := differences([*own_values(identification), *flight_values(identification)]):
        lines += [*differing, "where flights differ, intervals hold the spread between them"]
    return [*lines, *(f"doubted: {doubt}" for doubt in doubts(identification))]


def titles(identification: Identification, names: Sequence[str]) -> list[str]:
    """Return the names of quantities for people."""
    known = {q.name: q.title for q in identification.quantities}
    return [known.get(name, name) for name in names]


def traded(identification: Identification) -> list[str]:
    """Return what flights tell together alone, a sentence each."""
    pairs = [
        " against ".join(listed(titles(identification, names)) for names in pair)
        for pair in trades(identification)
    ]
    return [f"not told apart: {pair}; either, measured, tells the other" for pair in pairs]


def differences(each: Sequence[FlightValues]) -> list[str]:
    """Return what flights differ in: a sentence for what stands out or moves with something, one
    for all else.
    """
    differing = [values for values in each if values.differ]
    plain = [values.quantity.title for values in differing if not values.apart]
    alone = [values.text for values in differing if values.quantity.title not in plain]
    return [f"flights differ in: {'; '.join(plain)}", *alone] if plain else alone


def agreement(q: Identified) -> str:
    """Return whether flights agree on a quantity; empty where that was not tested."""
    if q.p != q.p:
        return ""
    return "agree" if q.p >= DIFFER else f"differ, p {q.p:.1g}"


def headline(identification: Identification) -> str:
    """Return the answer in one line: three numbers, and whether the flights tell them."""
    quantities = {q.name: q for q in identification.quantities}
    count = len(identification.models)
    by = f"{count} flight{'s' if count > 1 else ''}"
    observable = sum(q.observable for q in identification.quantities)
    leading = [next((quantities[n] for n in names if n in quantities), None) for names in ANSWERS]
    answers = [
        f"{q.name} {interval(q)[0]} ({half_width(q, q.low, q.high)}, {TELLS[q.observable]})"
        for q in leading
        if q
    ]
    return (
        f"{by} of {identification.prior.name}: {listed(answers)}; {observable} of "
        f"{len(quantities)} are told"
    )


def change(rows: Sequence[HeldOutErrors]) -> str:
    """Return how far the residual of held-out flights changes from the vehicle file to the
    identified one.
    """
    both = []
    for kind in ("force", "torque"):
        before, after = (
            np.sqrt(np.sum([np.square(getattr(r, kind)) for r in rows if r.model == model]))
            for model in ("vehicle file", "identified")
        )
        if before > 0:
            fall = 1.0 - after / before
            both.append(f"{kind} {'falls' if fall >= 0 else 'rises'} by {percent(abs(fall))}")
    return (
        f"On {flights(len({row.flight for row in rows}))} the residual {listed(both)}."
        if both
        else ""
    )


OBSERVABLE = PALETTE[0]
OTHER = PALETTE[1]
PRIOR = "0.85"
REACH = 2.2  # of the axis, in half widths of the prior [1]
ACROSS = 3  # panels beside each other
MARKS = {"vehicle file": ("o", PALETTE[1]), "identified": ("s", PALETTE[0])}


def interval_figure(identification: Identification) -> Figure:
    """Return value and 95 % interval of each quantity on the scale of its prior's, with its numbers
    beside.
    """
    shown = identification.quantities
    figure, grid = new_figure(1, 1, width=9.6, height=1.3 + 0.27 * len(shown))
    ax = grid[0, 0]
    for place, q in enumerate(shown):
        value, *ends = (place_in_prior(q, v) for v in (q.value, q.low, q.high))
        colour = OBSERVABLE if q.observable else OTHER
        ax.hlines(place, -1, 1, color=PRIOR, linewidth=9, label="prior, 95 %", zorder=1)
        ax.plot(np.clip(ends, -REACH, REACH), [place, place], color=colour, linewidth=2.4, zorder=2)
        ax.plot(
            np.clip(value, -REACH, REACH),
            place,
            marker="o" if abs(value) <= REACH else "<" if value < 0 else ">",
            markersize=5.5,
            color=colour,
            markerfacecolor=colour if q.observable else "white",
            linestyle="none",
            label="told by the flights" if q.observable else "not told: the prior's",
            zorder=3,
        )
        number_text, ends_text = interval(q)
        ax.text(REACH + 0.12, place, f"{number_text}   ({ends_text})", va="center")
    ax.set_yticks(range(len(shown)), [q.title for q in shown])
    ax.set(xlim=(-REACH, REACH), ylim=(len(shown) - 0.4, -0.6), xticks=[-2, -1, 0, 1, 2])
    ax.set_xlabel(
        "place in the prior: 0 its middle, ±1 its 95 % (of logarithms where a quantity is positive)"
    )
    ax.axvline(0.0, color="0.6", linewidth=0.7, zorder=0)
    ax.tick_params(axis="y", length=0)
    ax.spines[["top", "right", "left"]].set_visible(False)
    legend(figure)
    return figure


def place_in_prior(q: Identified, value: float) -> float:
    """Return where a value lies in the prior: 0 in its middle, -1 and 1 at the ends of its 95 %."""
    low, high = q.prior
    if q.quantity.positive:
        value = math.log(value)
        low = math.log(low)
        high = math.log(high)
    return (value - 0.5 * (low + high)) / max(0.5 * (high - low), 1e-300)


def agreement_figure(identification: Identification, each: Sequence[FlightValues]) -> Figure:
    """Return what each flight tells alone of each quantity, beside what all tell together."""
    rows = math.ceil(len(each) / ACROSS)
    count = len(identification.models)
    figure, grid = new_figure(rows, ACROSS, width=10.5, height=0.9 + 1.75 * rows)
    for place, ax in enumerate(grid.ravel()):
        if place >= len(each):
            ax.set_visible(False)
            continue
        _flights(ax, each[place])
        ax.set_xticks(range(count), [str(i + 1) if count <= 15 else "" for i in range(count)])
        ax.set_xlim(-0.6, count - 0.4)
        if place >= len(each) - ACROSS:
            ax.set_xlabel("flight, in the order given")
    legend(figure)
    return figure


def _flights(ax, values: FlightValues) -> None:
    q = values.quantity
    factor, shown = shown_in(q)
    ax.axhspan(factor * q.low, factor * q.high, color=PRIOR, zorder=0, label="all together, 95 %")
    ax.axhline(factor * q.value, color="0.5", linewidth=0.9, zorder=1)
    apart = np.isin(values.names, values.apart)
    for out, colour, mark, label in (
        (False, OBSERVABLE, "o", "one flight alone, 95 %"),
        (True, OTHER, "D", "a flight that stands out"),
    ):
        i = np.flatnonzero(np.isfinite(values.value) & (apart == out))
        if len(i):
            ax.vlines(
                i, factor * values.low[i], factor * values.high[i], color=colour, linewidth=1.6
            )
            ax.plot(i, factor * values.value[i], mark, markersize=5, color=colour, label=label)
    p = "" if math.isnan(q.p) else f"p {q.p:.2g}" if q.p >= 0.001 else "p < 0.001"
    weight = "bold" if values.differ else "normal"
    ax.set_title(q.title, loc="left", fontsize=10, fontweight=weight)
    ax.set_title(p, loc="right", fontsize=10, fontweight=weight)
    ax.set_ylabel(f"[{shown or '1'}]")
    ax.ticklabel_format(axis="y", useOffset=False)
    _tidy(ax)


def residual_figure(rows: Sequence[HeldOutErrors]) -> Figure:
    """Return the RMS of held-out force and torque by axis, a mark a model and flight."""
    from matplotlib.ticker import LogLocator, NullLocator

    kinds = [("force", "N"), ("torque", "N·m")][: 1 + bool(np.isfinite(rows[0].torque).all())]
    figure, grid = new_figure(1, len(kinds), width=4.5 * len(kinds), height=3.0)
    flights = list(dict.fromkeys(row.flight for row in rows))
    models = list(dict.fromkeys(row.model for row in rows))
    for ax, (name, unit) in zip(grid[0], kinds, strict=True):
        factor, shown = suited(max(np.max(getattr(row, name)) for row in rows), unit)
        for row in rows:
            shift = 0.18 * (models.index(row.model) - 0.5 * (len(models) - 1))
            if len(flights) > 1:
                shift += 0.1 * (flights.index(row.flight) / (len(flights) - 1) - 0.5)
            values = factor * getattr(row, name)
            mark, colour = MARKS[row.model]
            ax.plot(np.arange(3) + shift, values, mark, color=colour, markersize=7, label=row.model)
        ax.set_xticks(range(3), [f"{name} {axis}" for axis in "xyz"])
        ax.set(yscale="log", ylabel=f"RMS [{shown}]", xlim=(-0.5, 2.5))
        low, high = ax.get_ylim()
        ax.set_ylim(low / 1.5, 1.5 * high)
        ax.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        ax.yaxis.set_major_formatter(PLAIN_TICKS)
        ax.yaxis.set_minor_locator(NullLocator())
        _tidy(ax)
    legend(figure)
    return figure


def _tidy(ax) -> None:
    ax.grid(axis="y", alpha=0.3, linewidth=0.6)
    ax.set_axisbelow(True)
    ax.spines[["top", "right"]].set_visible(False)
