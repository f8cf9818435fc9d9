"""Which channels one block of the lifted linear system sees, and what symmetry ties together.

A block is fitted once and used once per view. About the vertical, physics in W is the same along x and along
y: the horizontal block has two views (x; y, turned by 90 degrees), pooled in its fit. A circle flown one way
round locks force and velocity in a fixed quarter-turn relation, which an untied fit takes for physics and
carries off the circle: on simulated flights the tied fit has 0.2 N error 0.8 s ahead on an unseen
lemniscate, the untied 1.7 N.
"""

import dataclasses as dc

import numpy as np

_CHI = {"fx": 0, "fy": 1, "fz": 2, "tx": 3, "ty": 4, "tz": 5}
_ZETA = {"vx": 0, "vy": 1, "vz": 2, "wx": 3, "wy": 4, "wz": 5}


@dc.dataclass(frozen=True)
class View:
    """Signed selections: labels (l, 6) of chi, inputs (p, 6) of zeta; the first `outputs` labels are fitted."""

    labels: np.ndarray
    inputs: np.ndarray
    outputs: int

    @property
    def selected(self) -> np.ndarray:
        """(outputs, 6) the predicted channels of chi."""
        return self.labels[: self.outputs]


@dc.dataclass(frozen=True)
class Block:
    """One fitted block: `views` share its matrices; `size` lifted states a view, 2 `pairs` of them oscillate.

    swings: whether an oscillation may begin by itself, as that of a payload that is pushed; the vertical force
    oscillates with the horizontal swing only.
    """

    name: str
    views: tuple[View, ...]
    size: int
    pairs: int
    swings: bool = False


def symmetric_blocks(size: int, *, torque: bool) -> list[Block]:
    """Blocks tied by symmetry about the vertical; `size` lifted states each (x, y and z use 3 `size` in all).

    Rotation by 90 degrees takes x to y and y to -x, so that w_y, t_y of the first view are -w_x, -t_x of the
    second. It takes body rates and torques with it, which holds while the yaw angle stays small. Reflection
    forbids any coupling between the horizontal and the vertical.
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
    """Untied blocks of `size` lifted states: all of zeta, three outputs each (chi in any frame)."""
    force = "fx fy fz tx ty tz" if torque else "fx fy fz"
    blocks = [Block("force", (_view(force, "vx vy vz wx wy wz", 3),), size, (size - 3) // 3)]
    if torque:
        view = _view("tx ty tz fx fy fz", "vx vy vz wx wy wz", 3)
        blocks.append(Block("torque", (view,), size, (size - 3) // 3))
    return blocks


def turns(zeta: np.ndarray) -> list[np.ndarray]:
    """The eight images of zeta (n, 6) under quarter turns about the vertical and the mirror y -> -y."""
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
