"""What the verbs that fly sweeps share: options, the check of the cluster, the title and the cost."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from typer import Option

from diagrams.batch.failed_run import FailedRun
from diagrams.cli.output import Advance
from diagrams.cli.reproduce.campaign import Campaign

if TYPE_CHECKING:
    from diagrams.batch.campaign import Record
    from diagrams.robustness.robustness import Sweep

CASES = "cases"  # folder in --out with a file for every case
OutOfCases = Annotated[
    Path | None, Option("--out", metavar="DIR", help="Folder for figures and every case, to resume from.")
]
Scheduler = Annotated[
    str, Option(metavar="ADDRESS", help="Fly on the Dask cluster of this scheduler: tcp://HOST:PORT.")
]
Duration = Annotated[float, Option(min=10.0, max=3600.0, help="Of a flight, after the ramp [s].")]


def make_sweep(run: Campaign, scheduler: str, duration: float) -> "Sweep":
    """Return the sweep of the run's options.

    Raises: ValueError: where no scheduler answers, or on an unknown solver; before any work.
    """
    from diagrams.batch.cluster import client

    if scheduler:
        with client(scheduler):
            pass
    from diagrams.robustness.robustness import Sweep
    from np_drake.mpc.solvers import require_solver

    require_solver(run.solver)
    folder = run.folder / CASES if run.out else None
    return Sweep(run.seed, run.solver, duration, folder=folder, jobs=run.jobs, scheduler=scheduler)


def trained(advance: Advance) -> Callable[[int, int], None]:
    """Return an `on_training(done, total)` that leaves the bar at its start."""
    return lambda done, total: advance(0.0, f"{done} of {total} trainings")


def require_result(records: "Sequence[Record]") -> None:
    """Check that one case has a result.

    Raises: FailedRun: if none has.
    """
    if all("error" in record for record in records):
        raise FailedRun(f"no flight has a result; the first: {records[0]['error']}")


def title_of(run: Campaign, duration: float) -> str:
    """Return the part of a title that names seeds, duration, training seed and solver."""
    first, *_, last = [*run.seeds, run.seeds[-1]]
    seeds = f"seed {first}" if first == last else f"seeds {first} … {last}"
    return f"{seeds}, {duration:g} s, trained on seed {run.seed}, {run.solver}"


def cost(records: "Sequence[Record]") -> str:
    """Return the line on the processor time of all cases."""
    minutes = sum(record["seconds"] or 0.0 for record in records) / 60
    return f"processor time of all cases: {minutes:.0f} min"
