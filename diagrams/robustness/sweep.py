"""What the studies that fly sweeps share: the sweep and the title."""

from collections.abc import Callable

from diagrams.batch.flown import FlownRun
from diagrams.batch.run import Advance
from diagrams.robustness.robustness import Sweep
from np_drake.mpc.solvers import require_solver


def make_sweep(run: FlownRun, duration: float) -> Sweep:
    """Return the sweep of a run.

    Args:
        run: seed, solver and workers.
        duration: of a flight, after the ramp [s].
    Raises: ValueError: on an unknown solver; before any work.
    """
    require_solver(run.solver)
    return Sweep(run.seed, run.solver, duration, workers=run.workers)


def trained(advance: Advance) -> Callable[[int, int], None]:
    """Return an `on_training(done, total)` that leaves the bar at its start."""
    return lambda done, total: advance(0.0, f"{done} of {total} trainings")


def title_of(run: FlownRun, duration: float) -> str:
    """Return the part of a title that names seeds, duration, training seed and solver.

    Args:
        run: seeds and solver.
        duration: of a flight, after the ramp [s].
    """
    first, *_, last = [*run.seeds, run.seeds[-1]]
    seeds = f"seed {first}" if first == last else f"seeds {first} … {last}"
    return f"{seeds}, {duration:g} s, trained on seed {run.seed}, {run.solver}"
