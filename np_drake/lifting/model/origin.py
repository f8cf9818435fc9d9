"""What a trained predictor was trained on, and whether a controller may fly it."""

import dataclasses as dc
from typing import Any, Protocol, TypeVar

from np_drake.labels import LabelConfig
from np_drake.vehicle import Vehicle


class Trained(Protocol):
    """A dataclass with a `summary` of its training."""

    @property
    def summary(self) -> dict[str, Any]: ...


M = TypeVar("M", bound=Trained)


def origin_of(frame: str, vehicle: Vehicle, label: LabelConfig) -> dict[str, Any]:
    """Frame of force and velocity, the mass that labels reckon with [kg], and their low-pass."""
    return {"frame": frame, "mass": vehicle.mass, "label": dc.asdict(label)}


def with_origin(model: M, origin: dict[str, Any]) -> M:
    """The model with `origin` in its summary, and so in its file."""
    return dc.replace(model, summary={**model.summary, "origin": origin})  # type: ignore[type-var]


def with_rotor_lag(model: M, lag: float) -> M:
    """The model with the lag of its vehicle's rotors in its summary [s]: through it goes the command in flight."""
    return dc.replace(model, summary={**model.summary, "rotor_lag": lag})  # type: ignore[type-var]


def rotor_lag_of(model: Trained) -> float:
    """The lag that the model was given [s]; 0 where it has none."""
    return float(model.summary.get("rotor_lag", 0.0))


def require_origin(model: Trained, origin: dict[str, Any]) -> None:
    """Raises ValueError where the model was trained on other labels than it would be fed; silent where unknown."""
    trained = model.summary.get("origin", {})
    for name, value in origin.items():
        if name in trained and trained[name] != value:
            raise ValueError(
                f"predictor: was trained with {name} {trained[name]}; here it is {value}. Train it on such labels."
            )
