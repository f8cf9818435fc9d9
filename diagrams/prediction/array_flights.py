"""Real flights of the paper's estimation table: arrays of wrench and motion."""

import dataclasses as dc
from pathlib import Path

import numpy as np

from diagrams.batch.options import required
from diagrams.batch.run import Advance, Run
from np_drake.lifting.model.lifted_model import MODE_DICTIONARY, PAPER, LiftedModel
from np_drake.lifting.training.train import make_config, train
from np_drake.logs.formats.neurobem import TESTS, TRAINING, read_wrenches
from np_drake.residual_model import FlightForecasts
from np_drake.residual_models.neural_predictor import NeuralPredictor, PredictorOptions
from np_drake.skill.response import jerk
from np_drake.training_data.segments import Segment

MASS, GRAVITY = 0.752, np.array([0.0, 0.0, 9.8])  # with which the arrays were made, in body axes [kg, m/s²]


@dc.dataclass(frozen=True)
class Flight:
    """One flight of the estimation table; the first of `flights` is the training segment."""

    name: str  # in the paper's table
    segment: Segment

    @property
    def jerk(self) -> np.ndarray:
        """Magnitude of the third derivative of position, (n,) [m/s³].

        The arrays hold f = m (specific force - g e_z).
        """
        s = self.segment
        return jerk(s.chi[:, :3] / MASS + GRAVITY, s.zeta[:, 3:], s.step)


def flights(folder: Path) -> list[Flight]:
    """Return the training segment and the test flights.

    Raises: OSError, LogError: where one is missing or cannot be read.
    """
    names = {TRAINING: "training segment", **TESTS}
    found = [(name, read_wrenches(folder / "npy" / f"{stem}.npy")) for stem, name in names.items()]
    return [Flight(name, Segment(s.chi, s.zeta, s.step)) for name, s in found]


def arrays(study: str, neurobem: Path | None) -> list[Flight]:
    """Return the arrays of the real flights, the training segment first.

    Args:
        study: name of the study that asks.
        neurobem: folder of the flights; None: it was not given.
    Raises: ValueError: if the folder is not given, or a flight is not usable.
    """
    return flights(neurobem_folder(study, neurobem))


def neurobem_folder(study: str, neurobem: Path | None) -> Path:
    """Return the folder of the NeuroBEM flights.

    Args:
        study: name of the study that asks.
        neurobem: folder; None: it was not given.
    Raises: ValueError: if it is not given.
    """
    where = "give the folder of the NeuroBEM flights as --neurobem DIR or NP_DRAKE_NEUROBEM."
    return required(neurobem, f"{study}: {where}")


def trained(run: Run, training: Flight, epochs: int | None = None) -> tuple[dict[str, LiftedModel], dict[str, dict]]:
    """Train `paper` and `mode-dictionary` on one segment.

    Args:
        run: seed and progress bar.
        training: training segment.
        epochs: passes of `paper`; None: its default.
    Returns: the models and their settings, by configuration.
    """
    models, settings = {}, {}
    for name in (PAPER, MODE_DICTIONARY):
        config = make_config(name, frame="body", seed=run.seed, epochs=epochs)
        with run.progress(f"training {name}") as advance:

            def tell(epoch: int, total: int, loss: float, advance: Advance = advance) -> None:
                advance(epoch / total, f"loss {loss:.4g}")

            models[name] = train([training.segment], config, on_epoch=tell).model
            advance(1.0)
        settings[name] = dc.asdict(config)
    return models, settings


def settings_lines(settings: dict[str, dict]) -> list[str]:
    """Return a line for every configuration with its settings."""
    return [f"{name}: {values}" for name, values in settings.items()]


def forecasts(model: LiftedModel, flight: Flight) -> FlightForecasts:
    """Return all forecasts of a model on a flight, force and torque predicted.

    Args:
        model: trained model.
        flight: flight of at least its window.
    Raises: ValueError: if it is too short.
    """
    course = NeuralPredictor(model, PredictorOptions(torque="predict")).along(flight.segment.chi, flight.segment.zeta)
    if course is None or len(flight.segment) < model.window + 2:
        raise ValueError(f"{flight.name}: at least {model.window + 2} samples are needed.")
    return course
