"""Page of an identification: what the flights tell of a vehicle, how sure, and how well it predicts
another flight.
"""

from collections.abc import Sequence
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from diagrams.identification.figures import (
    agreement_figure,
    flights_line,
    interval_figure,
    residual_figure,
)
from diagrams.identification.ghosts import (
    HORIZON,
    Ghosts,
    error_figure,
    ghosts_of,
    motion_figure,
    path_figure,
    title_of,
)
from diagrams.identification.text import (
    KINDS,
    RATIOS,
    agreement,
    differences,
    headline,
    interval,
    lead,
    not_told,
    prior_interval,
)
from np_drake.diagnosis.report.words import capital, listed, measure
from np_drake.files import page
from np_drake.files.atomic_file import require_writable
from np_drake.files.number_text import NOTHING, fixed
from np_drake.files.page import Section
from np_drake.flight_log import FlightLog
from np_drake.identification.flight_agreement import FlightValues, flight_values, own_values
from np_drake.identification.identify import Identification
from np_drake.identification.validation import HORIZONS, HeldOut

PAGE, TEMPLATE = "identification.html", Path(__file__).with_name("page.html.j2")
VEHICLE = "vehicle.yaml"
PICTURES = ("intervals", "agreement", "residuals", "ghosts_path", "ghosts_motion", "ghosts_error")


def write_page(
    found: Identification,
    rows: list[HeldOut],
    judging: list[FlightLog],
    folder: Path,
    *,
    parts: Sequence[tuple[float, float]] = (),
) -> Path:
    """Write `identification.html` and its figures to a folder, and return the path of the page.

    Args:
        judging: these flights; the first that holds position, velocity and attitude gives the
            ghosts.
        parts: share of each that counts, first and last [1]; default: whole flights.
    Raises: OSError: if the folder cannot be written.
    """
    require_writable(folder / PAGE)
    each = sorted([*own_values(found), *flight_values(found)], key=lambda told: not told.differ)
    figures: dict[str, Figure | None] = dict.fromkeys(PICTURES)
    figures["intervals"] = interval_figure(found)
    if each:
        figures["agreement"] = agreement_figure(found, each)
    if rows:
        figures["residuals"] = residual_figure(rows, per_mass=found.basis.ratios)
    shown, why = _ghosts(found, judging, parts)
    if shown is not None:
        figures["ghosts_path"] = path_figure(shown)
        figures["ghosts_motion"] = motion_figure(shown)
        figures["ghosts_error"] = error_figure(shown)
    ghosts = {
        "ghosts": "" if shown is None else title_of(shown),
        "no_ghosts": why,
        "thirds": bool(parts),
    }
    section = Section(TEMPLATE, content(found, rows, each) | ghosts)
    return page.write_page(
        folder / PAGE, f"Identification · {found.prior.name}", [section], figures
    )


def _ghosts(
    found: Identification, judging: Sequence[FlightLog], parts: Sequence[tuple[float, float]]
) -> tuple[Ghosts | None, str]:
    """Return the ghosts of the first flight that can be predicted; None, and why there are none."""
    why = "No flight was held out."
    for number, log in enumerate(judging):
        if log.lacks:
            lacking = listed(["position" if w == "height" else w for w in log.lacks])
            why = f"{log.name} holds no {lacking}: no ghosts."
            continue
        try:
            return ghosts_of(found, log, parts[number] if parts else (0.0, 1.0)), ""
        except ValueError as error:
            why = f"{str(error).rstrip('.')}: no ghosts."
    return None, why


def content(
    found: Identification, rows: Sequence[HeldOut], each: Sequence[FlightValues]
) -> dict[str, Any]:
    """Return the values that the template uses, with numbers formatted as text."""
    drive = KINDS[found.basis.drive]
    units = ("N/kg", "N·m/kg") if found.basis.ratios else ("N", "N·m")
    return {
        "vehicle": found.prior.name,
        "headline": headline(found),
        "lead": lead(found, rows),
        "ratios": capital(RATIOS) + "." if found.basis.ratios else "",
        "file": "" if found.basis.ratios else VEHICLE,
        "not_told": [(capital(listed(names)), why, way) for way, names, why in not_told(found)],
        "header": [
            "quantity",
            "value",
            "95 %",
            "prior, 95 %",
            "told by",
            *(["flights"] if each else []),
        ],
        "quantities": [
            [
                q.name,
                *interval(found, q),
                prior_interval(found, q),
                "flights" if q.told else "prior",
                *([agreement(q)] if each else []),
            ]
            for q in found.quantities
        ],
        "agreeing": [told.quantity.name for told in each if not told.differ],
        "differing": [f"{capital(sentence)}." for sentence in differences(each)],
        "numbers": flights_line(found),
        "residual_header": [
            "flight",
            "model",
            *(f"{kind} {axis}" for kind in ("force", "torque") for axis in "xyz"),
        ],
        "residuals": [_residual(row, units) for row in rows],
        "open_header": [
            "flight",
            "model",
            *(f"{name}, {h:g} s" for h in HORIZONS for name in _OPEN),
        ],
        "open_loop": [_open_loop(row) for row in rows if np.isfinite(row.open_loop).any()],
        "horizon": f"{HORIZON:g}",
        "flights": [
            *((model.flight.name, "fitted") for model in found.models),
            *((name, "held out") for name in dict.fromkeys(row.flight for row in rows)),
        ],
        "facts": [
            ("rotors driven by", drive),
            ("geometry of", found.prior.name),
            ("mass", _mass(found)),
            ("np_drake", version("np_drake")),
        ],
        "notes": list(found.notes),
    }


_OPEN = {
    "position": ("m", 1.0),
    "velocity": ("m/s", 1.0),
    "attitude": ("°", 180 / np.pi),
    "rates": ("rad/s", 1.0),
}


def _residual(row: HeldOut, units: tuple[str, str]) -> list[str]:
    both = zip((row.force, row.torque), units, strict=True)
    return [
        row.flight,
        row.model,
        *(measure(float(v), unit) for values, unit in both for v in values),
    ]


def _open_loop(row: HeldOut) -> list[str]:
    cells = [row.flight, row.model]
    for errors in row.open_loop:
        for value, (unit, factor) in zip(errors, _OPEN.values(), strict=True):
            if not np.isfinite(value):
                cells.append(NOTHING)
            elif unit == "°":
                cells.append(f"{fixed(factor * float(value), 1)}°")
            else:
                cells.append(measure(float(value), unit))
    return cells


def _mass(found: Identification) -> str:
    """Return where the mass comes from."""
    basis = found.basis
    if basis.mass is not None:
        return f"{measure(basis.mass, 'kg', 3)}, given"
    if basis.newtons:
        return "from commanded thrust, which counts as right"
    return (
        "not known"
        if basis.ratios
        else "from the thrust coefficient of the file, which counts as right"
    )
