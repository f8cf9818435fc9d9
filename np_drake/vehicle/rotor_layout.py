"""Where an autopilot has its rotors, in the order in which it numbers them, which of them a vehicle
file means, and what a rotor is called.
"""

import dataclasses as dc
import itertools
from collections.abc import Iterable, Sequence

import numpy as np

from np_drake.checks import require

# Distance over the mean arm at which two rotors are the same [1]. Source: own choice; a plus turned
# into an X is 0.77.
NEAR = 0.5


@dc.dataclass(frozen=True)
class RotorLayout:
    """Rotors in the order of an autopilot.

    positions: x forward, y left, in any one unit.
    directions: signs of the reaction torque about body z, 1 turns clockwise seen from above, 0 is
        not known.
    source: what states them.
    """

    positions: tuple[tuple[float, float], ...]
    directions: tuple[float, ...]
    source: str

    @property
    def props(self) -> str:
        """`in` or `out`, as the propellers of an X frame turn at the front; empty: not stated."""
        turns = [
            np.sign(x * y) * d for (x, y), d in zip(self.positions, self.directions, strict=True)
        ]
        return next((props for props, sign in PROPS.items() if turns == [sign] * 4), "")

    def order_of(
        self, positions: Sequence[Sequence[float]], directions: Sequence[float]
    ) -> list[int]:
        """Return for each rotor of a vehicle its number in this layout, from 0.

        Args:
            positions: of the vehicle's rotors in B, x and y first, in any one unit.
        Raises: ValueError: if no rotor here is near one of the vehicle's, or one turns the other
            way.
        """
        scaled = _scaled(self.positions)
        other = _scaled(positions)
        order = min(
            [list(order) for order in itertools.permutations(range(len(scaled)))],
            key=lambda chosen: float(np.sum((scaled[chosen] - other) ** 2)),
        )
        apart = float(np.linalg.norm(scaled[order] - other, axis=1).max())
        if apart > NEAR:
            listed = ", ".join(f"[{x:.3g}, {y:.3g}, 0]" for x, y in self.positions)
            raise ValueError(
                f"its rotors ({self.source}) must be where the vehicle file has them; one is "
                f"{apart:.2g} arms away from the nearest. Write rotor_positions: [{listed}], or "
                "measured ones."
            )
        turns = np.array(self.directions, float)[order]
        if np.any(turns * np.asarray(directions, float) < 0):
            wanted = [int(t or d) for t, d in zip(turns, directions, strict=True)]
            raise ValueError(
                f"its rotors ({self.source}) turn the other way than those of the vehicle file. "
                f"Write rotor_directions: {wanted} there if the log is right."
            )
        return order


PROPS = {"in": 1.0, "out": -1.0}  # the way the propellers turn at the front, seen from above


def directions_of(positions: Sequence[Sequence[float]], props: str) -> list[float]:
    """Return the directions of an X frame's rotors whose propellers turn in or out at the front.

    Raises: ValueError: if the frame is no X.
    """
    p = np.asarray([row[:2] for row in positions], float)
    turns = np.sign(p[:, 0] * p[:, 1])
    require(
        np.abs(p).min() > 0.1 * np.abs(p).max() and sum(turns) == 0,
        f"props: {props} must be of an X frame; write rotor_directions in the vehicle file.",
    )
    return (PROPS[props] * turns).tolist()


def _scaled(positions: Sequence[Sequence[float]]) -> np.ndarray:
    """Return positions (n, 2) about their middle, over the mean arm."""
    p = np.asarray([row[:2] for row in positions], float)
    p = p - p.mean(axis=0)
    return p / max(float(np.linalg.norm(p, axis=1).mean()), 1e-12)


FRONT_LEFT = (1.0, 1.0)
FRONT_RIGHT = (1.0, -1.0)
REAR_RIGHT = (-1.0, -1.0)
REAR_LEFT = (-1.0, 1.0)
FIRMWARE = {  # X frames with propellers that turn inwards at the front, the default of each
    # Source: PX4, airframe reference, Quadrotor x; ArduPilot, connecting motors, Quad X.
    "px4": RotorLayout(
        (FRONT_RIGHT, REAR_LEFT, FRONT_LEFT, REAR_RIGHT), (-1, -1, 1, 1), "PX4, Quadrotor x"
    ),
    "ardupilot": RotorLayout(
        (FRONT_RIGHT, REAR_LEFT, FRONT_LEFT, REAR_RIGHT), (-1, -1, 1, 1), "ArduPilot, Quad X"
    ),
    # Source: Betaflight, mixer, Quad X.
    "betaflight": RotorLayout(
        (REAR_RIGHT, FRONT_RIGHT, REAR_LEFT, FRONT_LEFT), (1, -1, -1, 1), "Betaflight, Quad X"
    ),
    # Source: Bitcraze, the firmware's M1 to M4.
    "crazyflie": RotorLayout(
        (FRONT_RIGHT, REAR_RIGHT, REAR_LEFT, FRONT_LEFT), (-1, 1, -1, 1), "Crazyflie, X"
    ),
}
SIDES = (("rear ", "", "front "), ("right", "", "left"))  # by the sign of x, and of y
# Coordinate over the mean arm below which a rotor is on an axis [1]; own choice: 6 deg.
ON_AXIS = 0.1


@dc.dataclass(frozen=True)
class RotorName:
    """What a rotor is called.

    number: in the vehicle file, from 1.
    place: seen from above, as front left.
    log: in the flight logs, as PX4 motor 3; empty: they do not name their rotors.
    """

    number: int
    place: str
    log: str = ""

    def __str__(self) -> str:
        """Return the name in a sentence."""
        return f"{self.place} rotor ({self.log or f'rotor {self.number} of the vehicle file'})"


def places(positions: Sequence[Sequence[float]]) -> list[str]:
    """Return where every rotor of a frame is, seen from above, as front left or rear.

    Rotors of one such place have their angles from the front beside it [deg].

    Args:
        positions: in B, x and y first, in any one unit.
    """
    p = _scaled(positions)
    signs = np.where(np.abs(p) < ON_AXIS, 0, np.sign(p)).astype(int) + 1
    names = [(SIDES[0][x] + SIDES[1][y]).strip() or "middle" for x, y in signs.tolist()]
    angles = np.degrees(np.abs(np.arctan2(p[:, 1], p[:, 0])))
    return [
        name if names.count(name) == 1 else f"{name} at {angle:.0f} deg"
        for name, angle in zip(names, angles, strict=True)
    ]


def rotor_names(
    positions: Sequence[Sequence[float]], motors: Iterable[Sequence[str]]
) -> list[RotorName]:
    """Return what the rotors of a vehicle are called.

    Args:
        positions: of its rotors in B, x and y first.
        motors: what each log calls them, in the order of the vehicle; empty: nothing.
    """
    called = [", ".join(dict.fromkeys(names)) for names in zip(*filter(None, motors), strict=True)]
    return [
        RotorName(number, *names)
        for number, names in enumerate(
            zip(places(positions), called or [""] * len(positions), strict=True), start=1
        )
    ]
