"""Random magnitudes and directions of effects, scaled to a vehicle."""

import numpy as np

from np_drake.vehicle import Vehicle


def log_uniform(rng: np.random.Generator, low: float, high: float) -> float:
    """Draw a number, every decade as likely."""
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def signed(rng: np.random.Generator, low: float, high: float) -> float:
    """Draw a log-uniform number of either sign."""
    return float(rng.choice([-1.0, 1.0])) * log_uniform(rng, low, high)


def arm(vehicle: Vehicle) -> float:
    """Return the mean distance of a rotor from Bo in the plane of the rotors [m]."""
    return float(np.mean(np.linalg.norm(np.array(vehicle.rotor_positions)[:, :2], axis=1)))


def direction(rng: np.random.Generator, rise: float | None = None) -> np.ndarray:
    """Draw a unit vector (3,).

    Args:
        rise: deviation of its slope, where it is about level [1]; None: in all directions.
    """
    n = rng.normal(size=3)
    if rise is not None:
        n[2] = rise * n[2] * np.hypot(n[0], n[1])
    return n / np.linalg.norm(n)


def drag_coefficients(
    rng: np.random.Generator, vehicle: Vehicle, low: float, high: float
) -> np.ndarray:
    """Draw drag coefficients (3,) in body axes: a heavy vehicle has more drag, and the level axes
    about the same.
    """
    lateral = log_uniform(rng, low, high) * vehicle.mass
    return lateral * rng.uniform([0.8, 0.8, 0.3], [1.2, 1.2, 1.2])
