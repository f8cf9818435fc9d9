"""Options that several studies share: what is parsed, and what `--help` says."""

import dataclasses as dc
from pathlib import Path
from typing import Annotated

from typer import Argument, Option

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


def required(option: Path | None, message: str) -> Path:
    """Return the folder that an option names.

    Args:
        option: its value; None: it is not given.
    Raises: ValueError: if it is not given.
    """
    if option is None:
        raise ValueError(message)
    return option


@dc.dataclass(frozen=True)
class RealFlightOptions:
    """Options of a study of the real flights."""

    folder: RealFlights = None
    neurobem: Neurobem = None
    only: Group = None

    def given(self, study: str) -> Path:
        """Return the folder of the real flights.

        Args: study: its name.
        Raises: ValueError: if none is given.
        """
        return required(
            self.folder, f"{study}: give the folder of the real flights as DIR or NP_DRAKE_REAL."
        )
