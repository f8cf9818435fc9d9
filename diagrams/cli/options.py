"""Options that verbs share, and what they mean everywhere."""

from pathlib import Path
from typing import Annotated

from typer import Option

from diagrams.studies.options import DEFAULT_SOLVER as DEFAULT_SOLVER
from diagrams.studies.options import Neurobem as Neurobem
from diagrams.studies.options import Reality as Reality
from diagrams.studies.options import Solver as Solver

EPILOG = (
    "Shared options: --seed fixes every random draw. --out DIR is created where it is "
    "missing and holds figures, "
    "logs and models. --json FILE, of every verb but vehicle, holds schema, version, seed, "
    "configuration and every "
    "value. --markdown FILE holds the printed tables. Files and folders are checked before "
    "long work; a file appears "
    "whole or not at all. --solver: sqp unless a scenario file names another; ipopt "
    "(MathematicalProgram) is the "
    "reference. "
    "Verbs of many cases: --jobs N local processes, or --scheduler ADDRESS of a Dask "
    "cluster; with --out DIR a case is "
    "a file in DIR/cases, and the same command goes on where it was interrupted."
)

OptionalPath = Path | None
Json = Annotated[OptionalPath, Option("--json", metavar="FILE", help="Write the values as JSON.")]
Out = Annotated[OptionalPath, Option("--out", metavar="DIR", help="Folder for logs and figures.")]
Markdown = Annotated[
    OptionalPath, Option("--markdown", metavar="FILE", help="Write the table as Markdown.")
]
Seed = Annotated[int, Option("--seed", min=0, max=2**31 - 1, help="Seed of every random draw.")]
Undrawn = Annotated[
    int, Option("--seed", min=0, max=2**31 - 1, hidden=True)
]  # of verbs without a random draw
Jobs = Annotated[int, Option("--jobs", min=1, max=1024, help="Processes on this machine.")]
DEFAULT_JOBS = 2  # of every verb of many cases
Scheduler = Annotated[
    str,
    Option(
        "--scheduler",
        metavar="ADDRESS",
        help="Work on the Dask cluster of this scheduler: tcp://HOST:PORT.",
    ),
]
OutOfCases = Annotated[
    OptionalPath,
    Option(
        "--out",
        metavar="DIR",
        help="Folder for figures, models and a file for every case, to resume from.",
    ),
]
CASES = "cases"  # folder in --out with a file for every case
VehicleFile = Annotated[
    OptionalPath,
    Option(
        "--vehicle",
        metavar="VEHICLE",
        help="Vehicle file (YAML) or a name of `np-drake vehicle list`; default: the paper's.",
    ),
]
Epochs = Annotated[
    int | None,
    Option("--epochs", min=1, max=1_000_000, help="Passes; default: the configuration's."),
]
Configuration = Annotated[
    str | None,
    Option(
        "--configuration",
        metavar="NAME",
        help="neural | lifted (world axes) | mode-dictionary (body axes) | paper, of np; "
        "payload_filter; gp | knode. Default: the first that suits the axes.",
    ),
]
Step = Annotated[
    float | None,
    Option(
        "--step",
        min=1e-4,
        max=1.0,
        help=(
            "Predictor step for flight logs [s]; default: the vehicle's, 0.02 for arms of 9 "
            "to 36 cm."
        ),
    ),
]
Replay = Annotated[bool, Option("--replay", help="Replay held-out flights in Drake too.")]
