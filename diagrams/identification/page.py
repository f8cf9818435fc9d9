"""Page of an identification: what the flights tell of a vehicle, how sure, and how well it predicts
another flight.
"""

from collections.abc import Sequence
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

from diagrams.identification import figures
from diagrams.identification.text import (
    KINDS,
    agreement,
    differences,
    headline,
    interval,
    lead,
    not_told,
    prior_interval,
)
from np_drake.diagnosis.report.words import capital, listed, measure, plain_name
from np_drake.files import page
from np_drake.files.atomic_file import require_writable
from np_drake.files.number_text import NOTHING, fixed
from np_drake.files.page import Section
from np_drake.identification.flight_agreement import FlightValues, flight_values, own_values
from np_drake.identification.identify import Identification
from np_drake.identification.validation import ERRORS, HORIZONS, HeldOut

PAGE, TEMPLATE = "identification.html", Path(__file__).with_name("page.html.j2")
VEHICLE = "vehicle.yaml"


def write_page(
    found: Identification, rows: list[HeldOut], folder: Path, *, thirds: bool = False
) -> Path:
    """Write `identification.html` and its figures to a folder, and return the path of the page.

    Args:
        thirds: whether the last third of the flight was held out, not other flights.
    Raises: OSError: if the folder cannot be written.
    """
    require_writable(folder / PAGE)
    each = sorted([*own_values(found), *flight_values(found)], key=lambda told: not told.differ)
    pictures = {
        "intervals": figures.interval_figure(found),
        "agreement": figures.agreement_figure(found, each) if each else None,
        "residuals": figures.residual_figure(rows) if rows else None,
    }
    sections = [Section(TEMPLATE, content(found, rows, each) | {"thirds": thirds})]
    return page.write_page(
        folder / PAGE, f"Identification · {found.prior.name}", sections, pictures
    )


def content(
    found: Identification, rows: Sequence[HeldOut], each: Sequence[FlightValues]
) -> dict[str, Any]:
    """Return the values that the template uses, with numbers formatted as text."""
    return {
        "vehicle": found.prior.name,
        "headline": headline(found),
        "lead": lead(found, rows),
        "file": VEHICLE,
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
                *interval(q),
                prior_interval(q),
                "flights" if q.told else "prior",
                *([agreement(q)] if each else []),
            ]
            for q in found.quantities
        ],
        "agreeing": [told.quantity.name for told in each if not told.differ],
        "differing": [f"{capital(sentence)}." for sentence in differences(each)],
        "numbers": ", ".join(
            f"{i + 1} {plain_name(model.flight.name)}" for i, model in enumerate(found.models)
        ),
        "residual_header": [
            "flight",
            "model",
            *(f"{kind} {axis}" for kind in ("force", "torque") for axis in "xyz"),
        ],
        "residuals": [_residual(row) for row in rows],
        "open_header": [
            "flight",
            "model",
            *(f"{name}, {h:g} s" for h in HORIZONS for name in ERRORS),
        ],
        "open_loop": [_open_loop(row) for row in rows if np.isfinite(row.open_loop).any()],
        "flights": [
            *((model.flight.name, "fitted") for model in found.models),
            *((name, "held out") for name in dict.fromkeys(row.flight for row in rows)),
        ],
        "facts": [
            ("rotors driven by", KINDS[found.basis.drive]),
            ("geometry of", found.prior.name),
            ("mass", _mass(found)),
            ("np_drake", version("np_drake")),
        ],
        "notes": list(found.notes),
    }


def _residual(row: HeldOut) -> list[str]:
    both = zip((row.force, row.torque), ("N", "N·m"), strict=True)
    sizes = [measure(float(v), unit) for values, unit in both for v in values]
    return [row.flight, row.model, *sizes]


def _open_loop(row: HeldOut) -> list[str]:
    cells = [row.flight, row.model]
    for errors in row.open_loop:
        *sizes, turned, rates = map(float, errors)
        cells += [measure(size, unit) for size, unit in zip(sizes, ("m", "m/s"), strict=True)]
        cells.append(f"{fixed(np.degrees(turned), 1)}°" if np.isfinite(turned) else NOTHING)
        cells.append(measure(rates, "rad/s"))
    return cells


def _mass(found: Identification) -> str:
    """Return where the mass comes from."""
    basis = found.basis
    if basis.mass is not None:
        return f"{measure(basis.mass, 'kg', 3)}, given"
    if basis.newtons:
        return "from commanded thrust, which counts as right"
    return "from the thrust coefficient of the file, which counts as right"
