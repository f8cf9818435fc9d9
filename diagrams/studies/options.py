"""Options that several studies share: what is parsed, what `--help` says, seeds and rows."""

import dataclasses as dc
from collections.abc import Collection
from pathlib import Path
from typing import Annotated, Any, Self

from typer import Argument, Option

from diagrams.batch.run import Run

DEFAULT_SOLVER = "sqp"  # of every verb that flies
Solver = Annotated[str, Option("--solver", help="sqp | ipopt (MathematicalProgram, the reference)")]
Seeds = Annotated[
    int, Option("--seeds", min=1, max=10_000, help="Evaluation flights a row, of seeds seed + 1, …")
]
Only = Annotated[
    list[str] | None, Option("--only", help="Only rows of these names (nominal is always flown).")
]
Group = Annotated[
    list[str] | None,
    Option("--only", metavar="GROUP", help="Only cases of this group; repeatable."),
]
Reality = Annotated[
    Path | None,
    Option(
        "--reality",
        metavar="FILE",
        help=(
            "Fly in the simulator of this scenario: corrected.yaml of a diagnosis, or "
            "paper_vehicle."
        ),
    ),
]
Neurobem = Annotated[
    Path | None,
    Option(
        "--neurobem", metavar="DIR", envvar="NP_DRAKE_NEUROBEM", help="Folder of the real flights."
    ),
]
RealFlights = Annotated[
    Path | None,
    Argument(
        metavar="DIR",
        envvar="NP_DRAKE_REAL",
        show_envvar=False,
        help="Folder of the campaigns (imrc, idsia, neural_fly, …); or NP_DRAKE_REAL.",
    ),
]
Duration = Annotated[float, Option(min=10.0, max=3600.0, help="Of a flight, after the ramp [s].")]


REAL_FLIGHTS = "real flights as DIR or NP_DRAKE_REAL"
NEUROBEM_FLIGHTS = "NeuroBEM flights as --neurobem DIR or NP_DRAKE_NEUROBEM"


def required(study: str, folder: Path | None, flights: str) -> Path:
    """Return the folder of these flights; ValueError where the study is given none."""
    if folder is None:
        raise ValueError(f"{study}: give the folder of the {flights}.")
    return folder


@dc.dataclass(frozen=True, kw_only=True)
class FlownRun(Run):
    """Run that flies the seeds after `seed`, which the training flight draws."""

    count: int = 5
    solver: str = DEFAULT_SOLVER

    @classmethod
    def of(cls, run: Run, **more: Any) -> Self:
        """Return the run with further fields."""
        return cls(**{field.name: getattr(run, field.name) for field in dc.fields(Run)}, **more)

    @property
    def seeds(self) -> list[int]:
        """Seeds of the evaluation flights."""
        return [self.seed + 1 + k for k in range(self.count)]

    @property
    def settings(self) -> dict[str, Any]:
        """Solver and seeds, as `--json` holds them."""
        return {"solver": self.solver, "seeds": self.seeds, "training_seed": self.seed}

    def title(self, flights: str = "flights a row", learner: str = "") -> str:
        """Return the title of a table: flights, seeds, what is trained, training seed, solver."""
        return (
            f"{self.count} {flights}, seeds {self.seeds[0]} … {self.seeds[-1]}, "
            f"{learner}trained on seed {self.seed}, {self.solver}"
        )


def chosen(option: str, names: Collection[str] | None, known: Collection[str]) -> list[str]:
    """Return the known names that are asked for, all where none is; ValueError on another one."""
    if unknown := set(names or ()) - set(known):
        raise ValueError(
            f"{option}: must be one of {', '.join(known)}; got {', '.join(sorted(unknown))}."
        )
    return [name for name in known if not names or name in names]
