"""`np-drake challenge active`: withheld effects found by flights that are designed as the diagnosis goes on."""

import dataclasses as dc
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Annotated, Any

from typer import Option

from diagrams.cli import options
from diagrams.cli.columns import MISSING, Column, tabulate
from diagrams.cli.output import Table, counted, progress
from diagrams.cli.reproduce.sweep import CASES, OutOfCases, cost, require_result
from diagrams.cli.runner import Report, Run, reports

if TYPE_CHECKING:
    from diagrams.challenge.active.next_motion import Room

Box = tuple[float, float, float]
FIGURE = "active.png"


@reports("challenge_active", seed=7000, out=OutOfCases)
def active(
    run: Run,
    seeds: Annotated[
        int, Option("--seeds", min=1, max=10_000, help="Vehicles, one of each seed: seed, seed + 1, …")
    ] = 100,
    start: Annotated[
        str,
        Option(
            metavar="KIND",
            help="First flights: ordinary (20 s, any kind) | short (6 s, gentle; vehicles drawn until ambiguous).",
        ),
    ] = "ordinary",
    flights: Annotated[int, Option(min=1, max=10, help="Most further flights.")] = 3,
    arms: Annotated[
        list[str] | None,
        Option("--arms", metavar="ARM", help="What flies them; default: all. See the table."),
    ] = None,
    box: Annotated[
        Box, Option("--box", metavar="X Y Z", help="Room [m]: floor at z = 0, x = y = 0 amid.")
    ] = (
        4.0,
        4.0,
        2.5,
    ),
    seconds: Annotated[
        float, Option("--seconds", min=5.0, max=120.0, help="Of a further flight [s].")
    ] = 20.0,
    speed: Annotated[float, Option("--speed", help="Largest speed [m/s].")] = 3.0,
    tilt: Annotated[float, Option("--tilt", help="Largest tilt [rad].")] = 0.5,
    jobs: options.Jobs = 1,
) -> Report:
    """Diagnose vehicles with withheld effects, design the next flight, fly it, and go on until one explanation stands.

    Beside the designed flight fly naive manoeuvres of the same length, each followed by a diagnosis of its own.
    --out DIR: cases to resume from, and a figure.
    """
    from diagrams.batch.campaign import run_campaign
    from diagrams.challenge.active import tables
    from diagrams.challenge.active.figure import active_figure
    from diagrams.challenge.active.loop import ActiveDiagnosis
    from diagrams.challenge.active.next_motion import ARMS, Room
    from diagrams.challenge.active.start import STARTS

    chosen = tuple(arms or ARMS)
    for option, values, known in (("--arms", chosen, ARMS), ("--start", (start,), tuple(STARTS))):
        for value in values:
            if value not in known:
                raise ValueError(f"{option} must be of {', '.join(known)}; got {value!r}.")
    if len(set(chosen)) < len(chosen):
        raise ValueError(f"--arms must differ from each other; got {', '.join(chosen)}.")
    room = Room(box, seconds, speed, tilt).check()
    config = {
        "start": start,
        **dc.asdict(STARTS[start]),
        "flights": flights,
        "arms": chosen,
        "room": dc.asdict(room),
    }
    every = [run.seed + k for k in range(seeds)]
    with progress("active diagnosis", 1.0) as advance:
        records = run_campaign(
            ActiveDiagnosis(start, chosen, flights, room),
            [{"seed": seed} for seed in every],
            config=config,
            folder=run.folder / CASES if run.out else None,
            jobs=jobs,
            on_progress=counted(advance, "vehicles"),
        )
    require_result(records)
    results = [record["result"] for record in records if "result" in record]
    lines = tables.lines(results, chosen, flights)
    begun = STARTS[start].seconds

    def figure():
        return active_figure(results, chosen, flights=flights, begun=begun, seconds=seconds)

    failed = [f"seed {r['case']['seed']}: {r['error']}" for r in records if "error" in r]
    return Report(
        printed(lines, begun=begun, seconds=seconds),
        config=config | {"seeds": every},
        metrics={"table": lines, "draws": tables.draws(results), "runs": records},
        summary=[
            f"{len(results)} vehicles, seeds {every[0]} … {every[-1]}, start {start}, {room_in_words(room)}",
            f"{tables.draws(results)['draws']} vehicles drawn, {tables.draws(results)['lost_draws']} lost at once",
        ],
        notes=[*failed, cost(records)],
        figures={FIGURE: figure},
    )


def room_in_words(room: "Room") -> str:
    """Return box, length and limits of a further flight."""
    box = " x ".join(f"{side:g}" for side in room.box)
    return f"room {box} m, {room.seconds:g} s a flight, at most {room.speed:g} m/s and {room.tilt:g} rad"


def printed(lines: Sequence[dict[str, Any]], *, begun: float, seconds: float) -> list[Table]:
    """Return the tables: all cases, those that the first flight leaves open, and the flights themselves.

    Args: begun, seconds: length of the first flights together, and of a further one [s].
    """
    numbers = range(len(lines[0]["settled"]))

    def by_flight(key: str, text: str, cell: Callable[[dict[str, Any]], str]) -> list[Column]:
        return [(f"{text} {k}", at(key, k, cell)) for k in numbers]

    def entropies(line: dict[str, Any]) -> str:
        return " → ".join(MISSING if h is None else f"{h:.2f}" for h in line["entropy"])

    def until(line: dict[str, Any]) -> str:
        used = line["flights"]
        return MISSING if used is None or used == float("inf") else f"{used:g}, {begun + used * seconds:g} s"

    n, each = lines[0]["right_class"][0]["n"], lines[0]["right_class_each"][0]["n"]
    still, stood = lines[0]["open"], lines[0]["right_alone_stood"][0]["n"]
    last = len(numbers) - 1
    every = [
        *by_flight("right_class", "right class, flights", rate),
        (f"each visible ({each}), flights {last}", at("right_class_each", last, rate)),
        *by_flight("settled", "one stands", share),
    ]
    opened = [
        *by_flight("right_alone", "right one alone", rate)[1:],
        *by_flight("right_alone_stood", f"right stood ({stood})", rate)[1:],
        ("entropy [nat]", entropies),
        ("flights until one stands", until),
    ]
    arm: list[Column] = [("arm", "arm")]
    return [
        tabulate(
            f"all {lines[0]['cases']} cases, {n} visible; by number of further flights", lines, arm + every
        ),
        tabulate(f"{still} cases that the first flight leaves open", lines, arm + opened),
        tabulate("further flights", lines, FLIGHTS),
    ]


def at(key: str, k: int, cell: Callable[[dict[str, Any]], str]) -> Callable[[dict[str, Any]], str]:
    """Return a cell of the k-th value of a list."""
    return lambda line: cell(line[key][k])


def rate(value: dict[str, Any]) -> str:
    """Return a proportion with its 95 % interval, in per cent."""
    if value["rate"] is None:
        return MISSING
    low, high = (100 * bound for bound in value["ci95"])
    return f"{100 * value['rate']:.0f} ({low:.0f} … {high:.0f})"


def share(value: dict[str, Any]) -> str:
    """Return a proportion in per cent."""
    return MISSING if value["rate"] is None else f"{100 * value['rate']:.0f}"


def _number(key: str, digits: int, factor: float = 1.0):
    return lambda line: MISSING if line[key] is None else f"{factor * line[key]:.{digits}f}"


FLIGHTS: tuple[Column, ...] = (
    ("arm", "arm"),
    ("flown", "flown"),
    ("beyond room, speed, tilt, thrust", lambda line: ", ".join(str(n) for n in line["broken"].values())),
    ("most used [%]", _number("worst", 0, 100.0)),
    ("in the simulator [%]", _number("simulated", 0, 100.0)),
    ("lost", "lost"),
    ("no motion", "no motion"),
    ("no answer", "no answer"),
    ("design, median [s]", _number("design_median", 1)),
    ("most [s]", _number("design_most", 1)),
)
