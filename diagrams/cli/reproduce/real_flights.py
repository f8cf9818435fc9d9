"""What the tables of real flights share: their folder, and the models that are trained on one of them."""

import dataclasses as dc
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from diagrams.prediction.array_flights import Flight
    from np_drake.lifting.model.lifted_model import LiftedModel


def required(table: str, neurobem: Path | None) -> Path:
    """Return the folder of the real flights.

    Raises: ValueError: if it is not given.
    """
    if neurobem is None:
        raise ValueError(
            f"{table}: give the folder of the NeuroBEM flights as --neurobem DIR or NP_DRAKE_NEUROBEM."
        )
    return neurobem


def arrays(table: str, neurobem: Path | None) -> "list[Flight]":
    """Return the arrays of the real flights, the training segment first.

    Raises: ValueError: if the folder is not given, or a flight is not usable.
    """
    folder = required(table, neurobem)
    from diagrams.prediction.array_flights import flights

    return flights(folder)


def trained(
    training: "Flight", seed: int, epochs: int | None = None
) -> tuple[dict[str, "LiftedModel"], dict[str, dict]]:
    """Train `paper` and `default` on one segment.

    Args: epochs: of `paper`; None: its default.
    Returns: the models and their settings, by configuration.
    """
    from diagrams.cli.train import behind_bar
    from np_drake.lifting.model.lifted_model import MODE_DICTIONARY, PAPER
    from np_drake.lifting.training.train import make_config, train

    models, settings = {}, {}
    for name in (PAPER, MODE_DICTIONARY):
        config = make_config(name, frame="body", seed=seed, epochs=epochs)
        models[name] = behind_bar(f"training {name}", partial(train, [training.segment], config))[0].model
        settings[name] = dc.asdict(config)
    return models, settings
