"""`np-drake reproduce`: a table of the paper beside ours, one sub-command a table."""

import typer
from typer.core import TyperGroup

from diagrams.cli.reproduce import (
    attach,
    configurations,
    cooperative,
    cost,
    estimation,
    experiments,
    flights,
    robustness,
    tracking,
    weights,
)


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
for name, table in (
    ("tracking", tracking.tracking),
    ("configurations", configurations.configurations),
    ("weights", weights.weights),
    ("gap", flights.gap),
    ("mhe", flights.mhe),
    ("theorem", flights.theorem),
    ("pendulum", weights.pendulum),
    ("estimation", estimation.estimation),
    ("sample-efficiency", estimation.sample_efficiency),
    ("response", estimation.response),
    ("hover", experiments.hover),
    ("attach", attach.attach),
    ("timing", experiments.timing),
    ("cooperative", cooperative.cooperative),
    ("robustness", robustness.robustness),
    ("cost", cost.cost),
):
    reproduce.command(name)(table)
