"""Channels that one block of the lifted linear system sees, and the symmetry that ties its views.

A block is fitted once and used once per view. About the vertical, physics in W is the same along x
and along y: the horizontal block has two views (x; y, turned by 90 degrees), pooled in its fit. A
circle flown in one direction locks force and velocity in a fixed quarter-turn relation. An untied
fit takes that relation for physics and keeps it off the circle: on simulated flights the tied fit
has 0.2 N error 0.8 s ahead on an unseen lemniscate, the untied 1.7 N.
"""

import dataclasses as dc

import numpy as np

_CHI = {"fx": 0, "fy": 1, "fz": 2, "tx": 3, "ty": 4, "tz": 5}  # index of each channel
_ZETA = {"vx": 0, "vy": 1, "vz": 2, "wx": 3, "wy": 4, "wz": 5}  # index of each channel


@dc.dataclass(frozen=True)
class View:
    """Signed selections of the channels of chi and zeta that one view of a block uses."""

    output: np.ndarray  # (6,) selection from chi of what is foreseen [1]
    inputs: np.ndarray  # (p, 6) selection from zeta [1]


@dc.dataclass(frozen=True)
class Block:
    """One fitted block of the lifted linear system, whose views share its matrices.

    lateral: whether it swings as a payload does; the vertical force oscillates with the horizontal
    swing only.
    """

    views: tuple[View, ...]
    lateral: bool


def symmetric_blocks(*, torque: bool) -> list[Block]:
    """Return blocks tied by symmetry about the vertical.

    Rotation by 90 degrees takes x to y and y to -x, so that w_y, t_y of the first view are -w_x,
    -t_x of the second. It takes body rates and torques with it, which holds while the yaw angle
    stays small. Reflection forbids any coupling between the horizontal and the vertical.
    """
    blocks = [
        Block((_view("fx", "vx wy"), _view("fy", "vy -wx")), True),
        Block((_view("fz", "vz"),), False),
    ]
    if torque:
        blocks.append(Block((_view("ty", "vx wy"), _view("-tx", "vy -wx")), True))
        blocks.append(Block((_view("tz", "wz"),), False))
    return blocks


def turns(zeta: np.ndarray) -> list[np.ndarray]:
    """Return the eight images of zeta (n, 6) under quarter turns about the vertical and the mirror
    y -> -y.
    """
    quarter, mirror = (
        zeta[:, [1, 0, 2, 4, 3, 5]] * [1, -1, 1, 1, -1, 1],
        np.array([1, -1, 1, -1, 1, -1]),
    )
    half = np.array([-1, -1, 1, -1, -1, 1])
    images = [zeta, quarter, zeta * half, quarter * half]
    return images + [image * mirror for image in images]


def _view(output: str, inputs: str) -> View:
    return View(_selection(output, _CHI)[0], _selection(inputs, _ZETA))


def _selection(names: str, index: dict[str, int]) -> np.ndarray:
    rows = np.zeros((len(names.split()), 6))
    for row, name in zip(rows, names.split(), strict=True):
        row[index[name.lstrip("-")]] = -1.0 if name.startswith("-") else 1.0
    return rows
