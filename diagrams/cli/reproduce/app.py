"""`np-drake reproduce`: a table of the paper beside ours, one sub-command a table."""

import typer
from typer.core import TyperGroup

from diagrams.cli.reproduce.attach import attach
from diagrams.cli.reproduce.closing import closing
from diagrams.cli.reproduce.configurations import configurations
from diagrams.cli.reproduce.cooperative import cooperative
from diagrams.cli.reproduce.cost import cost
from diagrams.cli.reproduce.deadlines import deadlines
from diagrams.cli.reproduce.estimation import estimation, response, sample_efficiency
from diagrams.cli.reproduce.experiments import hover, timing
from diagrams.cli.reproduce.faults import faults
from diagrams.cli.reproduce.flights import gap, mhe, theorem
from diagrams.cli.reproduce.margins import margins
from diagrams.cli.reproduce.models import models
from diagrams.cli.reproduce.payload_flights import payload_flights
from diagrams.cli.reproduce.real import real
from diagrams.cli.reproduce.replay import replay
from diagrams.cli.reproduce.robustness import robustness
from diagrams.cli.reproduce.tracking import tracking
from diagrams.cli.reproduce.vehicles import vehicles
from diagrams.cli.reproduce.weights import pendulum, weights

TABLES = (
    tracking, configurations, weights, gap, mhe, theorem, pendulum, estimation, sample_efficiency, response, hover,
    attach, timing, cooperative, robustness, margins, faults, cost, real,
    payload_flights, vehicles, models, closing, replay, deadlines,
)  # fmt: skip


class Tables(TyperGroup):
    """Group of tables that lists its names where one is unknown."""

    def resolve_command(self, context, arguments):
        """Return the sub-command.

        Raises: ValueError: on an unknown name.
        """
        if arguments and arguments[0] not in self.commands:
            raise ValueError(f"table: must be one of {', '.join(self.commands)}; got {arguments[0]!r}.")
        return super().resolve_command(context, arguments)


reproduce = typer.Typer(
    cls=Tables,
    help="A table or figure of the paper beside ours. Training flights draw --seed, evaluation flights the next ones.",
    add_completion=False,
    rich_markup_mode=None,
)
for table in TABLES:
    reproduce.command(table.__name__.replace("_", "-"))(table)
