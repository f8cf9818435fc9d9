"""What the verbs that fly several seeds share: options, seeds, title and the choice of rows."""

import dataclasses as dc
from collections.abc import Callable, Collection
from typing import Any

from diagrams.cli import options
from diagrams.cli.output import say
from diagrams.cli.runner import Run, Shared, counting, reports


@dc.dataclass(frozen=True, kw_only=True)
class Campaign(Run):
    """Run that flies the seeds after `seed`, which the training flight draws."""

    count: int
    solver: str

    @property
    def seeds(self) -> list[int]:
        """Seeds of the evaluation flights."""
        return [self.seed + 1 + k for k in range(self.count)]

    @property
    def settings(self) -> dict[str, Any]:
        """Solver and seeds, as the experiments take them and as `--json` holds them."""
        return {"solver": self.solver, "seeds": self.seeds, "training_seed": self.seed}

    def fly(self, name: str, experiment: Callable[..., list[dict]], rows: tuple, **more: Any) -> list[dict]:
        """Fly every row with every seed behind a progress bar; return the summaries of the flights."""
        with counting(name, "flights") as on_progress:
            more |= {"rows": rows, "workers": self.workers, "on_progress": on_progress}
            return experiment(self.folder, **self.settings, **more)

    def title(self, flights: str = "flights a row", learner: str = "") -> str:
        """Return the title of a table: flights, seeds, training seed and solver."""
        return (
            f"{self.count} {flights}, seeds {self.seeds[0]} … {self.seeds[-1]}, "
            f"{learner}trained on seed {self.seed}, {self.solver}"
        )


def campaign(*, seeds: int) -> Callable[[Callable], Callable[..., None]]:
    """Return the decorator of a verb `(run: Campaign, own options) -> Report`, with `seeds` flights a row."""
    flown: list[Shared] = [
        ("count", options.Seeds, seeds),
        ("solver", options.Solver, options.DEFAULT_SOLVER),
    ]
    return reports("reproduce", seed=1000, out=options.OutOfCases, many=True, run=Campaign, first=flown)


def require_rows(names: Collection[str], known: Collection[str]) -> None:
    """Check the names given as `--only`.

    Raises: ValueError: on an unknown name.
    """
    if unknown := set(names) - set(known):
        raise ValueError(
            f"--only: must name rows of the table ({'; '.join(known)}); got {', '.join(sorted(unknown))}."
        )


def _present(row: str) -> str:
    """Return the present name of a row, and say so where an old one was given."""
    present = row.replace("np: pendulum", "payload_filter").replace("np: default", "np: delay-modal")
    if present != row:
        say(f"--only: row {row} is now called {present}.")
    return present


def choose_rows(rows: tuple, only: Collection[str] | None, always: Collection[str] = ("nominal",)) -> tuple:
    """Return the rows of these names, all where there are none.

    Args: always: rows that are never left out.
    Raises: ValueError: on an unknown name.
    """
    only = [_present(name) for name in only or ()]
    require_rows(only, [row.name for row in rows])
    return tuple(row for row in rows if not only or row.name in {*only, *always})
