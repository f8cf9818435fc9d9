"""What studies that fly several seeds share: options, seeds, title and the choice of rows."""

import dataclasses as dc
import logging
from collections.abc import Collection
from typing import Any, Self

from diagrams.batch.options import DEFAULT_SOLVER, Seeds, Solver
from diagrams.batch.run import Run

_log = logging.getLogger(__name__)


@dc.dataclass(frozen=True)
class FlownOptions:
    """Options of a study that flies every row with several seeds."""

    seeds: Seeds = 5
    solver: Solver = DEFAULT_SOLVER


@dc.dataclass(frozen=True, kw_only=True)
class FlownRun(Run):
    """Run that flies the seeds after `seed`, which the training flight draws."""

    count: int = 5
    solver: str = DEFAULT_SOLVER

    @classmethod
    def of(cls, run: Run, options: FlownOptions) -> Self:
        """Return the run with the seeds and the solver of these options."""
        shared = {field.name: getattr(run, field.name) for field in dc.fields(Run)}
        return cls(**shared, count=options.seeds, solver=options.solver)

    @property
    def seeds(self) -> list[int]:
        """Seeds of the evaluation flights."""
        return [self.seed + 1 + k for k in range(self.count)]

    @property
    def settings(self) -> dict[str, Any]:
        """Solver and seeds, as `--json` holds them."""
        return {"solver": self.solver, "seeds": self.seeds, "training_seed": self.seed}

    def title(self, flights: str = "flights a row", learner: str = "") -> str:
        """Return the title of a table: flights, seeds, training seed and solver.

        Args:
            learner: what is trained, with a blank behind it; empty where that is plain.
        """
        return (
            f"{self.count} {flights}, seeds {self.seeds[0]} … {self.seeds[-1]}, "
            f"{learner}trained on seed {self.seed}, {self.solver}"
        )


def require_rows(names: Collection[str], known: Collection[str]) -> None:
    """Check the names given as `--only`.
    Raises: ValueError: on an unknown name.
    """
    if unknown := set(names) - set(known):
        raise ValueError(
            f"--only: must name rows of the table ({'; '.join(known)}); got "
            f"{', '.join(sorted(unknown))}."
        )


def _present(row: str) -> str:
    """Return the present name of a row, and say so where an old one was given."""
    present = row.replace("np: pendulum", "payload_filter")
    if present != row:
        _log.warning("--only: row %s is now called %s.", row, present)
    return present


def choose_rows(
    rows: tuple, only: Collection[str] | None, always: Collection[str] = ("nominal",)
) -> tuple:
    """Return the rows of these names, all where there are none.

    Args:
        only: names; None or empty: all.
    Raises: ValueError: on an unknown name.
    """
    only = [_present(name) for name in only or ()]
    require_rows(only, [row.name for row in rows])
    return tuple(row for row in rows if not only or row.name in {*only, *always})
