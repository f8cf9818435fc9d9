"""What the verbs that fly sweeps share: options, the sweep and the title."""

from collections.abc import Callable
from typing import TYPE_CHECKING, Annotated

from typer import Option

from diagrams.cli.output import Advance
from diagrams.cli.reproduce.campaign import Campaign

if TYPE_CHECKING:
    from diagrams.robustness.robustness import Sweep

Duration = Annotated[float, Option(min=10.0, max=3600.0, help="Of a flight, after the ramp [s].")]


def make_sweep(run: Campaign, duration: float) -> "Sweep":
    """Return the sweep of the run's options.

    Raises: ValueError: on an unknown solver; before any work.
    """
    from diagrams.robustness.robustness import Sweep
    from np_drake.mpc.solvers import require_solver

    require_solver(run.solver)
    return Sweep(run.seed, run.solver, duration, workers=run.workers)


def trained(advance: Advance) -> Callable[[int, int], None]:
    """Return an `on_training(done, total)` that leaves the bar at its start."""
    return lambda done, total: advance(0.0, f"{done} of {total} trainings")


def title_of(run: Campaign, duration: float) -> str:
    """Return the part of a title that names seeds, duration, training seed and solver."""
    first, *_, last = [*run.seeds, run.seeds[-1]]
    seeds = f"seed {first}" if first == last else f"seeds {first} … {last}"
    return f"{seeds}, {duration:g} s, trained on seed {run.seed}, {run.solver}"
