"""Page that compares the flights of several controllers: one table, one figure, and the replay of
each.
"""

from collections.abc import Sequence
from pathlib import Path

from diagrams.loop import flight_figures
from diagrams.loop.controller_config import LEARNED
from diagrams.loop.flight_result import FlightResult
from np_drake.files.number_text import fixed
from np_drake.files.page import Section, write_page

TEMPLATE = Path(__file__).with_name("comparison.html.j2")


def sentence(flights: Sequence[FlightResult]) -> str:
    """Return which controller has the least position error, and that of the others."""
    errors = sorted((flight.metrics()["position_rmse"], flight.label) for flight in flights)
    (least, best), *others = ((f"{100 * error:.2f} cm", label) for error, label in errors)
    rest = "".join(f"; {label} {error}" for error, label in others)
    return f"{best} has the least position error, {least} RMS{rest}."


def models(flights: Sequence[FlightResult]) -> str:
    """Return which model file each learned controller flew; empty where all are packaged."""
    learned = [
        flight.config.controller for flight in flights if flight.config.controller.kind in LEARNED
    ]
    if not any(one.predictor for one in learned):
        return ""
    flown = [f"{one.name} flew {one.predictor or 'the packaged one'}" for one in learned]
    return f"Model files: {', '.join(flown)}."


def stem(flight: FlightResult) -> str:
    """Return the beginning of the names of a flight's files."""
    return f"{flight.config.name}_{flight.label.replace(' + ', '_').replace(' ', '_')}"


def write_comparison(
    flights: Sequence[FlightResult], folder: Path, *, lost: Sequence[str] = ()
) -> Path:
    """Write figure and page of a comparison, and return the page's path.

    Args:
        folder: that takes the files, and holds those of every flight.
    Raises: OSError: if a file cannot be written.
    """
    first = flights[0]
    name = first.config.name
    content = {
        "name": name,
        "vehicle": first.config.vehicle.name,
        "seed": first.seed,
        "headline": sentence(flights).rstrip("."),
        "conditions": " ".join(filter(None, [conditions(first), models(flights)])),
        "rows": [_row(flight) for flight in flights],
        "lost": lost,
        "files": [(flight.label, stem(flight)) for flight in flights],
    }
    picture = flight_figures.overlay(flights, f"{name} · seed {first.seed}")
    return write_page(
        folder / f"{name}_comparison.html",
        f"{name}: controllers compared",
        [Section(TEMPLATE, content)],
        {f"{name}_comparison": picture},
    )


def conditions(flight: FlightResult) -> str:
    """Return payload, speed and wind of a flight in a sentence."""
    config = flight.config
    hung = config.reality.hung
    reference = config.reference
    wind = config.reality.wind
    carried = (
        f"{hung.mass * 1e3:.4g} g on {hung.length:.3g} m of {hung.tether}"
        if hung.tether != "none"
        else "no payload"
    )
    blown = f", wind {', '.join(f'{value:g}' for value in wind)} m/s" if any(wind) else ""
    moved = "" if reference.track == "hover" else f" at {reference.speed:.3g} m/s"
    return f"{reference.track}{moved}, {carried}{blown}; {config.end:.3g} s of flight."


def _row(flight: FlightResult) -> tuple[str, ...]:
    """Return label, E_xy, E_z [cm], median solve time [ms] and failures of a flight."""
    m = flight.metrics()
    errors = (fixed(100 * m[name], 2) for name in ("E_xy", "E_z"))
    return flight.label, *errors, fixed(m["solve_ms"]["median"], 2), str(m["solve_failures"])
