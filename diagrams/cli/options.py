"""Options that verbs share."""

from pathlib import Path
from typing import Annotated

import typer

Json = Annotated[
    Path | None, typer.Option("--json", metavar="FILE", help="Write the figures as JSON for machines.")
]
Out = Annotated[Path | None, typer.Option("--out", metavar="DIR", help="Folder for logs and figures.")]
Seed = Annotated[int, typer.Option("--seed", min=0, max=2**31 - 1, help="Seed of every random draw.")]
VehicleFile = Annotated[
    Path | None, typer.Option("--vehicle", metavar="FILE", help="Vehicle file (YAML); default: the paper's.")
]
Repair = Annotated[bool, typer.Option("--repair", help="Mend a few bad rows of a log and say so.")]
Configuration = Annotated[
    str,
    typer.Option(
        "--configuration",
        metavar="NAME",
        help="Predictor: default | paper | dictionary | dmdc | delay-dmdc | ridge; or gp | knode.",
    ),
]
Step = Annotated[float, typer.Option("--step", min=1e-4, max=1.0, help="Predictor step for flight logs [s].")]
Markdown = Annotated[
    Path | None, typer.Option("--markdown", metavar="FILE", help="Write the table as Markdown.")
]
Seeds = Annotated[int, typer.Option("--seeds", min=1, help="Evaluation flights a row, of seeds seed + 1, …")]
Solver = Annotated[str, typer.Option("--solver", help="ipopt | sqp")]
Jobs = Annotated[int, typer.Option("--jobs", min=1, help="Processes.")]
Only = Annotated[
    list[str] | None, typer.Option("--only", help="Only rows of these names (nominal is always flown).")
]
Neurobem = Annotated[
    Path | None,
    typer.Option("--neurobem", metavar="DIR", envvar="NP_DRAKE_NEUROBEM", help="Folder of the real flights."),
]
Undrawn = Annotated[
    int, typer.Option("--seed", min=0, hidden=True)
]  # every verb takes it; here nothing is drawn


def evaluation_seeds(seed: int, seeds: int) -> list[int]:
    """Seeds of the evaluation flights: those after `seed`, which the training flight draws."""
    return [seed + 1 + k for k in range(seeds)]
