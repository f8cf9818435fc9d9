"""Account of an export: how it carries each effect."""

import dataclasses as dc
from collections.abc import Iterable, Mapping
from typing import Any

from np_drake.vehicle import Vehicle

EXACT, APPROXIMATE, LEFT_OUT = "exact", "approximate", "left out"
Law = Mapping[
    str, tuple[str, str]
]  # identifier or place of an effect -> how a format carries it, and in words
_SENSOR = (LEFT_OUT, "an error of the sensors, not of the motion")
_UNKNOWN = (LEFT_OUT, "this export does not know it")


@dc.dataclass(frozen=True)
class Carried:
    """One line of the account.

    identifier: of the effect, or `gravity`.   how: exact | approximate | left out.   note: by what, or why not.
    """  # noqa: E501

    identifier: str
    how: str
    note: str


def carried(effects: Iterable[Any], law: Law) -> list[Carried]:
    """Return a line for every effect, in the given order: none is left out in silence."""
    return [Carried(effect.identifier, *how_carried(effect, law)) for effect in effects]


def not_carried(vehicle: Vehicle) -> list[Carried]:
    """Return a line for every part of a vehicle file that it states and no format holds."""
    parts = (
        ("throttle", vehicle.throttle, "the commands are thrust or rotor speed"),
        ("rate_loop", vehicle.rate_loop, "the file has no autopilot"),
        ("calibration.imu_position", vehicle.calibration.imu_position, "the file has no sensors"),
    )
    return [Carried(name, LEFT_OUT, why) for name, value, why in parts if value is not None]


def how_carried(effect: Any, law: Law) -> tuple[str, str]:
    """Return how a format carries an effect, and in words."""
    rest = _SENSOR if hasattr(effect, "measure") else _UNKNOWN
    return law.get(effect.identifier) or law.get(getattr(effect, "place", ""), rest)
