"""`np-drake challenge logs`: logs of other origin: rows left out, wrong conventions, round trips through files."""

from collections.abc import Callable
from typing import Annotated, Any

from typer import Option

from diagrams.batch.workers import Workers, failures
from diagrams.cli import options
from diagrams.cli.runner import Report, Run, counting, reports

PARTS = ("thinned", "conventions", "round-trip")


@reports("challenge_logs", seed=3700, out=options.OutOfCases, many=True)
def logs(
    run: Run,
    flights: Annotated[
        int, Option(min=3, max=10_000, help="Logs of clean flights that are thinned, three to a case.")
    ] = 50,
    wrong: Annotated[int, Option(min=1, max=100, help="Logs in wrong conventions.")] = 40,
    only: Annotated[
        list[str] | None, Option("--only", metavar="PART", help=f"Of {', '.join(PARTS)}.")
    ] = None,
    full: Annotated[bool, Option("--full", help="Round trips under every effect; hours.")] = False,
) -> Report:
    """Thin clean logs, write logs in wrong conventions and round trips through files, and count what is answered."""
    parts = tuple(only or PARTS)
    for part in parts:
        if part not in PARTS:
            raise ValueError(f"--only must be of {', '.join(PARTS)}; got {part!r}.")
    bodies: dict[str, Callable[..., tuple[Any, Any]]] = {
        "thinned": _thinned,
        "conventions": _conventions,
        "round-trip": _round_trip,
    }
    tables: list[Any] = []
    metrics: dict[str, Any] = {}
    for part in parts:
        table, values = bodies[part](run.seed, flights=flights, wrong=wrong, full=full, workers=run.workers)
        tables.append(table)
        metrics[part] = values
    config = {"flights": flights, "wrong": wrong, "full": full, "only": list(parts)}
    shown = ", ".join(f"{name} {value}" for name, value in config.items() if name != "only")
    notes = failures(run.workers.finished)
    return Report(tables, config, metrics, summary=[f"seed {run.seed}, {shown}"], notes=notes)


def _thinned(seed: int, *, flights: int, workers: Workers, **_: Any) -> tuple[Any, Any]:
    from diagrams.challenge.imported import thinned

    with counting("thinned logs", "cases") as tell:
        cases = thinned.answer_thinned(flights, seed=seed, workers=workers, on_progress=tell)
    rows = []
    for answer, text in (("verdict", "as it is"), ("naive", "without detection of timing")):
        timed, other = thinned.count(cases, answer)
        rows.append((text, 3 * len(cases), len(cases), timed, other))
    title = "clean flights, every 2nd, 3rd or 4th row kept"
    header = ["diagnosis", "logs", "cases", "a timing cause (asked 0)", "another cause or unknown"]
    return (title, header, rows), [case.row() for case in cases]


def _conventions(seed: int, *, wrong: int, workers: Workers, **_: Any) -> tuple[Any, Any]:
    from diagrams.challenge.imported import conventions

    with counting("wrong conventions", "flights") as tell:
        found = conventions.answer_conventions(wrong, seed=seed, workers=workers, on_progress=tell)
    rows = []
    for text, few in (("one", 1), ("two", 2)):
        own = [log for log in found if len(log.errors) == few]
        counts = [sum(log.outcome == outcome for log in own) for outcome in conventions.OUTCOMES]
        rows.append((text, len(own), *counts, sum(log.control for log in own)))
    header = ["errors", "logs", *conventions.OUTCOMES, "accepted with their own map"]
    return ("logs in other conventions than declared (asked: none accepted)", header, rows), [
        log.row() for log in found
    ]


def _round_trip(seed: int, *, full: bool, workers: Workers, **_: Any) -> tuple[Any, Any]:
    from diagrams.challenge.imported import round_trip

    with counting("round trips", "flights") as tell:
        trips = round_trip.answer_round_trips(seed=seed, full=full, workers=workers, on_progress=tell)
    same, all_same = round_trip.count(trips)
    rows: list[tuple[Any, ...]] = [
        (
            *(trip.effect, trip.input, trip.frames, trip.rate, trip.semantics),
            "yes" if trip.names else " + ".join(trip.imported) or "none",
            "yes" if trip.inside else ", ".join(trip.outside),
        )
        for trip in trips
    ]
    rows.append(("all", "", "", "", f"{len(trips)}", f"{same}", f"{all_same}"))
    header = ["effect", "input", "frames", "Hz", "a row's command", "same names", "parameters inside"]
    return ("round trips through a table", header, rows), [trip.row() for trip in trips]
