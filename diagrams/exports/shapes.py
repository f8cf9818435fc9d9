"""Shape of a vehicle for other simulators: one box that collides; body, arms and rotor discs that
are seen.
"""

import dataclasses as dc

import numpy as np

from np_drake.vehicle import Vehicle

BODY, ARM, DISC = 0.5, 0.07, 0.04  # sizes over the arm's length, as in our replay; own choice [1]
HEIGHT = 0.2  # of body and box over the arm's length; own choice: no vehicle file tells it [1]
DARK, PALE = (0.2, 0.2, 0.22, 1.0), (0.6, 0.6, 0.6, 0.6)  # red, green, blue, opacity


@dc.dataclass(frozen=True)
class Box:
    """Box in body axes B: centre (3,) and size (3,) [m], turned about z by `yaw` [rad]."""

    name: str
    center: np.ndarray
    size: np.ndarray
    yaw: float = 0.0


def hull(vehicle: Vehicle) -> Box:
    """Return the box that collides: as wide as the rotor discs reach, as high as the body."""
    p, height = np.array(vehicle.rotor_positions, float), HEIGHT * arm(vehicle)
    lower, upper = p.min(axis=0) - vehicle.rotor_radius, p.max(axis=0) + vehicle.rotor_radius
    lower[2], upper[2] = (
        min(p[:, 2].min(), 0.0) - 0.5 * height,
        max(p[:, 2].max(), 0.0) + 0.5 * height,
    )
    return Box("hull", 0.5 * (lower + upper), upper - lower)


def seen(vehicle: Vehicle) -> list[Box]:
    """Return body and arms as boxes that are seen."""
    size = arm(vehicle)
    boxes = [Box("body", np.zeros(3), size * np.array([BODY, BODY, HEIGHT]))]
    for i, p in enumerate(np.array(vehicle.rotor_positions, float)):
        length = float(np.hypot(p[0], p[1]))
        thick = ARM * size
        center = p * [0.5, 0.5, 1.0]
        boxes.append(
            Box(
                f"arm_{i + 1}",
                center,
                np.array([length, thick, thick]),
                float(np.arctan2(p[1], p[0])),
            )
        )
    return boxes


def disc(vehicle: Vehicle) -> tuple[float, float]:
    """Return radius and thickness of a rotor disc, about the rotor's axis [m]."""
    return vehicle.rotor_radius, DISC * arm(vehicle)


def arm(vehicle: Vehicle) -> float:
    """Return the mean distance of the rotors from Bo [m]."""
    return float(np.linalg.norm(np.array(vehicle.rotor_positions, float), axis=1).mean())
