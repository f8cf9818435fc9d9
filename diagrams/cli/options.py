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
