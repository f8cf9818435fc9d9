"""Training conditions of a predictor, and whether a controller may use it."""

import dataclasses as dc
from typing import Any, Protocol, TypeVar

from np_drake.labels import LabelConfig
from np_drake.vehicle import Vehicle


class Trained(Protocol):
    """A dataclass with a `summary` of its training."""

    @property
    def summary(self) -> dict[str, Any]:
        """Key figures and conditions of the training."""


M = TypeVar("M", bound=Trained)


def origin_of(frame: str, vehicle: Vehicle, label: LabelConfig) -> dict[str, Any]:
    """Return the conditions of a training by name.

    Args:
        vehicle: whose mass the labels assume [kg].
    """
    return {"frame": frame, "mass": vehicle.mass, "label": dc.asdict(label)}


def with_origin(model: M, origin: dict[str, Any]) -> M:
    """Return the model with `origin` in its summary, and so in its file.

    Args:
        origin: as of `origin_of`.
    """
    return dc.replace(model, summary={**model.summary, "origin": origin})  # type: ignore[type-var]


def with_rotor_lag(model: M, lag: float) -> M:
    """Return the model with the rotor lag of its vehicle in its summary; in flight it filters the
    command.

    Args:
        lag: time constant [s].
    """
    return dc.replace(model, summary={**model.summary, "rotor_lag": lag})  # type: ignore[type-var]


def rotor_lag_of(model: Trained) -> float:
    """Return the rotor lag stored with the model [s]; 0 where there is none."""
    return float(model.summary.get("rotor_lag", 0.0))


def require_origin(model: Trained, origin: dict[str, Any]) -> None:
    """Check that the model was trained on labels like those that it will be fed.

    An origin that is unknown passes.

    Args:
        origin: of what it will be fed, or a part of it.
    Raises: ValueError: if an item of the origin differs.
    """
    trained = model.summary.get("origin", {})
    for name, value in origin.items():
        if name in trained and trained[name] != value:
            raise ValueError(
                f"predictor: was trained with {name} {trained[name]}; here it is {value}. "
                f"Train it on such labels."
            )
