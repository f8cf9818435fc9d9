"""`np-drake reproduce`: a table of the paper beside ours, one sub-command a table."""

import typer
from typer.core import TyperGroup

from diagrams.cli import (
    reproduce_attach,
    reproduce_configurations,
    reproduce_cooperative,
    reproduce_cost,
    reproduce_estimation,
    reproduce_experiments,
    reproduce_flights,
    reproduce_robustness,
    reproduce_tracking,
    reproduce_weights,
)


class Tables(TyperGroup):
    """Names the tables there are, where one is unknown."""

    def resolve_command(self, context, arguments):
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
    ("tracking", reproduce_tracking.tracking),
    ("configurations", reproduce_configurations.configurations),
    ("weights", reproduce_weights.weights),
    ("gap", reproduce_flights.gap),
    ("mhe", reproduce_flights.mhe),
    ("theorem", reproduce_flights.theorem),
    ("pendulum", reproduce_weights.pendulum),
    ("estimation", reproduce_estimation.estimation),
    ("sample-efficiency", reproduce_estimation.sample_efficiency),
    ("response", reproduce_estimation.response),
    ("hover", reproduce_experiments.hover),
    ("attach", reproduce_attach.attach),
    ("timing", reproduce_experiments.timing),
    ("cooperative", reproduce_cooperative.cooperative),
    ("robustness", reproduce_robustness.robustness),
    ("cost", reproduce_cost.cost),
):
    reproduce.command(name)(table)
