"""Axes of the robustness sweep, and the settings at which it flies: along every axis, and on the
grid of three.
"""

import dataclasses as dc
import itertools
from collections.abc import Sequence

import numpy as np

Setting = dict[str, float]  # value of every axis by name


@dc.dataclass(frozen=True)
class Axis:
    """A quantity that is varied while the others stay at their base."""

    name: str  # key of a case
    title: str  # in tables and plots
    unit: str  # of base and values
    base: float
    values: tuple[float, ...]  # that are flown

    def says(self, value: float) -> str:
        """Return the value with its unit; `× 2` of a factor."""
        return f"× {value:g}" if self.unit == "1" else f"{value:g} {self.unit}"


AXES = (
    Axis("mass", "payload", "kg", 0.26, (0.0, 0.13, 0.26, 0.38, 0.5)),
    Axis("length", "tether", "m", 0.8, (0.4, 0.6, 0.8, 1.2, 1.6)),
    Axis("speed", "speed", "m/s", 1.5, (0.5, 1.0, 1.5, 2.0, 2.5, 3.0)),
    Axis("wind", "wind", "m/s", 0.0, (0.0, 2.0, 4.0, 6.0, 8.0)),
    Axis("gust", "gusts", "m/s", 0.0, (0.0, 0.5, 1.0, 1.5, 2.0)),
    Axis("noise", "noise", "1", 1.0, (1.0, 1.5, 2.0, 2.5, 3.0)),
    Axis("lag", "motor lag", "s", 0.03, (0.02, 0.03, 0.04, 0.05, 0.06)),
    Axis("delay", "command delay", "s", 0.0, (0.0, 0.01, 0.02, 0.03, 0.045, 0.06, 0.08)),
    Axis("loss", "thrust loss", "1/s", 0.0, (0.0, 0.0015, 0.003, 0.0045, 0.006)),
    Axis("gain", "loop gain", "1", 1.0, ()),  # factor on the thrust; of the margins alone
)
FLOWN = tuple(axis for axis in AXES if axis.values)  # along which the sweep goes
BASE: Setting = {axis.name: axis.base for axis in AXES}


@dc.dataclass(frozen=True)
class Grid:
    """Every payload mass with every tether length at every speed."""

    mass: tuple[float, ...] = (0.0, 0.13, 0.26, 0.38, 0.5)  # [kg]
    length: tuple[float, ...] = (0.4, 0.6, 0.8, 1.2, 1.6)  # [m]
    speed: tuple[float, ...] = (0.5, 1.0, 1.5, 2.0, 2.5)  # [m/s]

    def thinned(self, count: int) -> "Grid":
        """Return the grid of `count` evenly spaced values of each quantity, the ends among them.

        Raises: ValueError: where it has no two values, or more than there are.
        """
        most = len(self.mass)
        if not 2 <= count <= most:
            raise ValueError(f"grid: must have 2 to {most} values of each quantity; got {count}.")
        at = np.linspace(0, most - 1, count).round().astype(int)
        return Grid(
            *(tuple(values[i] for i in at) for values in (self.mass, self.length, self.speed))
        )

    def setting(self, mass: float, length: float, speed: float) -> Setting:
        """Return what is flown at a point; without payload the tether's base, since there is none
        to differ.

        Args:
            mass: of the payload [kg].
            length: of the tether [m].
            speed: on the circle [m/s].
        """
        length = length if mass > 0 else BASE["length"]
        return BASE | {"mass": mass, "length": length, "speed": speed}

    def settings(self) -> list[Setting]:
        """Return the setting of every point; points without payload share theirs."""
        return [
            self.setting(*point) for point in itertools.product(self.mass, self.length, self.speed)
        ]


def axis_settings(axes: Sequence[Axis]) -> list[Setting]:
    """Return the settings along the axes, each of which passes through the base."""
    return [BASE | {axis.name: value} for axis in axes for value in axis.values]


def distinct(settings: Sequence[Setting]) -> list[Setting]:
    """Return every setting once, in ascending order of the values."""
    return [dict(items) for items in sorted({tuple(setting.items()) for setting in settings})]
