"""Real flights of the paper's estimation table: arrays of wrench and motion."""

import dataclasses as dc
from collections.abc import Iterable
from pathlib import Path

import numpy as np

from diagrams.batch.options import required
from diagrams.batch.run import Advance, Run
from np_drake.lifting.model.lifted_model import BY_AXES, PAPER, LiftedModel
from np_drake.lifting.training.train import Config, make_config, train
from np_drake.logs.formats.neurobem_wrenches import (
    MASS,
    SUBTRACTED,
    read_training,
    read_wrenches,
    table_files,
)
from np_drake.residual_model import FlightForecasts
from np_drake.residual_models.neural_predictor import NeuralPredictor
from np_drake.training_data.segments import Segment

OURS = {PAPER: "np: paper", BY_AXES["body"]: "np"}  # configuration: row
NAIVE = ("persistence", "linear")  # rows without training
LEARNED = 4000  # samples that are trained on, ten seconds as in the paper [1]


REACH = 10  # samples on either side of the slope that gives the jerk [1]


def jerk(s: np.ndarray, w: np.ndarray, step: float) -> np.ndarray:
    """Return |d³p/dt³| (n,) from the specific force and the body rates [m/s³].

    d³p/dt³ = R (ds/dt + w x s), ds/dt the least-squares slope over `REACH` samples on either side.
    It uses future samples: it selects samples for evaluation, and no predictor sees it.

    Args:
        s: (n, 3) specific force in B [m/s²].
        w: (n, 3) body rates in B [rad/s].
        step: sampling time [s].
    Raises: ValueError: if there are fewer than 2 REACH + 1 samples.
    """
    if len(s) < 2 * REACH + 1:
        raise ValueError(f"jerk: at least {2 * REACH + 1} samples are needed; got {len(s)}.")
    lags = np.arange(-REACH, REACH + 1)
    slope = lags / (step * np.sum(lags**2))
    padded = np.pad(s, ((REACH, REACH), (0, 0)), mode="edge")
    rate = np.stack([np.correlate(padded[:, i], slope, mode="valid") for i in range(3)], axis=1)
    return np.linalg.norm(rate + np.cross(w, s), axis=1)


@dc.dataclass(frozen=True)
class Flight:
    """One flight of the estimation table; the first of `flights` is the training segment."""

    name: str  # in the paper's table, or of the file
    segment: Segment

    @property
    def jerk(self) -> np.ndarray:
        """Magnitude of the third derivative of position, (n,) [m/s³].

        The arrays hold f = m (specific force - g e_z).
        """
        s = self.segment
        return jerk(s.chi[:, :3] / MASS + SUBTRACTED, s.zeta[:, 3:], s.step)


def flights(folder: Path) -> list[Flight]:
    """Return the training segment and all other flights in the folder, see `table_files`.

    Raises: OSError, LogError: where none is there or one cannot be read.
    """
    found = {"training segment": read_training(folder)}
    found |= {name: read_wrenches(path) for name, path in table_files(folder).items()}
    return [Flight(name, Segment(s.chi, s.zeta, s.step)) for name, s in found.items()]


def named(found: list[Flight], name: str, study: str) -> Flight:
    """Return the flight of that name.
    Raises: ValueError: if it is not among them.
    """
    for flight in found:
        if flight.name == name:
            return flight
    raise ValueError(
        f"{study}: the folder must hold {name}; it has "
        f"{', '.join(flight.name for flight in found)}."
    )


def arrays(study: str, neurobem: Path | None) -> list[Flight]:
    """Return the arrays of the real flights, the training segment first.

    Args:
        neurobem: folder of the flights; None: it was not given.
    Raises: ValueError: if the folder is not given, or a flight is not usable.
    """
    return flights(neurobem_folder(study, neurobem))


def neurobem_folder(study: str, neurobem: Path | None) -> Path:
    """Return the folder of the NeuroBEM flights.

    Args:
        neurobem: folder; None: it was not given.
    Raises: ValueError: if it is not given.
    """
    where = "give the folder of the NeuroBEM flights as --neurobem DIR or NP_DRAKE_NEUROBEM."
    return required(neurobem, f"{study}: {where}")


def configs(names: Iterable[str], seed: int) -> dict[str, Config]:
    """Return the configurations with their usual settings for these arrays, by name."""
    return {name: make_config(name, frame="body", seed=seed) for name in names}


def part(segment: Segment, start: int, stop: int) -> Segment:
    """Return the samples from `start` up to `stop`."""
    return Segment(segment.chi[start:stop], segment.zeta[start:stop], segment.step)


def trained(run: Run, training: Flight) -> tuple[dict[str, LiftedModel], dict[str, dict]]:
    """Train our rows on ten seconds of one segment.
    Returns: the models and their settings, by configuration.
    """
    models, settings = {}, {}
    for name, config in configs(OURS, run.seed).items():
        with run.progress(f"training {name}") as advance:

            def tell(epoch: int, total: int, loss: float, advance: Advance = advance) -> None:
                advance(epoch / total, f"loss {loss:.4g}")

            models[name] = train([part(training.segment, 0, LEARNED)], config, on_epoch=tell).model
            advance(1.0)
        settings[name] = dc.asdict(config)
    return models, settings


def settings_lines(settings: dict[str, dict]) -> list[str]:
    """Return a line for every configuration with its settings."""
    return [f"{name}: {values}" for name, values in settings.items()]


def forecasts(model: LiftedModel, flight: Flight) -> FlightForecasts:
    """Return all forecasts of a model on a flight, force and torque predicted.
    Raises: ValueError: if it is too short.
    """
    course = NeuralPredictor(model, torque="predict").along(flight.segment.chi, flight.segment.zeta)
    if course is None or len(flight.segment) < model.warm_up + 2:
        raise ValueError(f"{flight.name}: at least {model.warm_up + 2} samples are needed.")
    return course
