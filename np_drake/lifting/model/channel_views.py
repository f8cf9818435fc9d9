"""Channels that one block of the lifted linear system sees, and the symmetry that ties its views.

A block is fitted once and used once per view. About the vertical, physics in W is the same along x and along
y: the horizontal block has two views (x; y, turned by 90 degrees), pooled in its fit. A circle flown in one
direction locks force and velocity in a fixed quarter-turn relation. An untied fit takes that relation for physics
and keeps it off the circle: on simulated flights the tied fit has 0.2 N error 0.8 s ahead on an unseen
lemniscate, the untied 1.7 N.
"""

import dataclasses as dc

import numpy as np

_CHI = {"fx": 0, "fy": 1, "fz": 2, "tx": 3, "ty": 4, "tz": 5}  # index of each channel
_ZETA = {"vx": 0, "vy": 1, "vz": 2, "wx": 3, "wy": 4, "wz": 5}  # index of each channel


@dc.dataclass(frozen=True)
class View:
    """Signed selections of the channels of chi and zeta that one view of a block uses."""

    labels: np.ndarray  # (l, 6) selection from chi [1]
    inputs: np.ndarray  # (p, 6) selection from zeta [1]
    outputs: int  # number of labels, counted from the first, that are fitted [1]

    @property
    def selected(self) -> np.ndarray:
        """Selection of the predicted channels of chi, (outputs, 6) [1]."""
        return self.labels[: self.outputs]


@dc.dataclass(frozen=True)
class Block:
    """One fitted block of the lifted linear system, whose views share its matrices.

    swings: whether an oscillation may begin by itself, as that of a payload that is pushed; the vertical force
    oscillates with the horizontal swing only.
    """

    name: str  # for messages and checkpoints
    views: tuple[View, ...]
    size: int  # lifted states of a view [1]
    pairs: int  # pairs of lifted states that oscillate [1]
    swings: bool = False


def symmetric_blocks(size: int, *, torque: bool) -> list[Block]:
    """Return blocks tied by symmetry about the vertical.

    Rotation by 90 degrees takes x to y and y to -x, so that w_y, t_y of the first view are -w_x, -t_x of the
    second. It takes body rates and torques with it, which holds while the yaw angle stays small. Reflection
    forbids any coupling between the horizontal and the vertical.

    Args:
        size: lifted states of a view [1]; the force in x, y and z takes 3 `size` in all.
        torque: whether it is predicted too.
    """
    horizontal = (_view("fx", "vx wy", 1), _view("fy", "vy -wx", 1))
    blocks = [
        Block("horizontal force", horizontal, size, (size - 1) // 2, swings=True),
        Block("vertical force", (_view("fz", "vz", 1),), size, (size - 1) // 2),
    ]
    if torque:
        tilting = (_view("ty fx", "vx wy", 1), _view("-tx fy", "vy -wx", 1))
        blocks.append(Block("tilting torque", tilting, size, (size - 1) // 2))
        blocks.append(Block("yaw torque", (_view("tz", "wz", 1),), size, (size - 1) // 2))
    return blocks


def free_blocks(size: int, *, torque: bool) -> list[Block]:
    """Return blocks without symmetry, for chi in any frame.

    Args:
        size: lifted states of a block [1], which sees all of zeta and has three outputs.
        torque: whether it is predicted too.
    """
    force = "fx fy fz tx ty tz" if torque else "fx fy fz"
    blocks = [Block("force", (_view(force, "vx vy vz wx wy wz", 3),), size, (size - 3) // 3)]
    if torque:
        view = _view("tx ty tz fx fy fz", "vx vy vz wx wy wz", 3)
        blocks.append(Block("torque", (view,), size, (size - 3) // 3))
    return blocks


def turns(zeta: np.ndarray) -> list[np.ndarray]:
    """Return the eight images of zeta (n, 6) under quarter turns about the vertical and the mirror y -> -y."""
    quarter, mirror = zeta[:, [1, 0, 2, 4, 3, 5]] * [1, -1, 1, 1, -1, 1], np.array([1, -1, 1, -1, 1, -1])
    half = np.array([-1, -1, 1, -1, -1, 1])
    images = [zeta, quarter, zeta * half, quarter * half]
    return images + [image * mirror for image in images]


def _view(labels: str, inputs: str, outputs: int) -> View:
    return View(_selection(labels, _CHI), _selection(inputs, _ZETA), outputs)


def _selection(names: str, index: dict[str, int]) -> np.ndarray:
    rows = np.zeros((len(names.split()), 6))
    for row, name in zip(rows, names.split(), strict=True):
        row[index[name.lstrip("-")]] = -1.0 if name.startswith("-") else 1.0
    return rows
