"""Tracking as a task to learn: what a policy sees, what it is paid, and what its action means."""

import dataclasses as dc

import numpy as np

from np_drake import attitude
from np_drake.scaling import ratios
from np_drake.vehicle import Vehicle

ACTION_SIZE = 4  # thrust and three torques [1]
OWN_SIZE = 18  # of an observation without the reference ahead [1]


@dc.dataclass(frozen=True)
class TrackingTask:
    """Observation, reward and end of an episode; the defaults are those for the paper's vehicle.

    Own choice: reach is twice the error of a fair controller, so that the reward still tells 3 cm from 5 cm.
    """

    ahead: tuple[float, ...] = (0.1, 0.2, 0.4)  # times from now at which the reference is shown [s]
    reach: float = 0.1  # position error that halves the reward [m]
    effort: float = 0.01  # reward that a full action costs [1]
    tolerance: float = 1.0  # position error beyond which the vehicle is lost [m]

    def check(self) -> "TrackingTask":
        """Return self after checking all values.

        Raises: ValueError: where one is impossible.
        """
        if not all(0 < t < np.inf for t in self.ahead):
            raise ValueError(f"TrackingTask: ahead must be positive and finite times [s]; got {self.ahead}.")
        for name in ("reach", "tolerance"):
            if not 0 < getattr(self, name) < np.inf:
                raise ValueError(f"TrackingTask: {name} must be positive and finite [m]; got {getattr(self, name)}.")
        if not 0 <= self.effort < np.inf:
            raise ValueError(f"TrackingTask: effort must be finite and not negative [1]; got {self.effort}.")
        return self

    @property
    def observation_size(self) -> int:
        """Number of entries of an observation."""
        return OWN_SIZE + 3 * len(self.ahead)

    def reward(self, error: np.ndarray, action: np.ndarray) -> float:
        """Return 1 / (1 + |error|² / reach²) - effort * mean(action²) [1].

        It is at most 1. Its integral over a flight is a time [s]: how long the vehicle was on its reference.

        Args:
            error: (3,) of position [m].
            action: (4,) in [-1, 1].
        """
        return float(1.0 / (1.0 + error @ error / self.reach**2) - self.effort * np.mean(np.square(action)))


def task_for(vehicle: Vehicle) -> TrackingTask:
    """Return the default task, scaled by the vehicle's size and time."""
    task, unit = TrackingTask(), ratios(vehicle)
    return dc.replace(
        task,
        ahead=tuple(unit.time * t for t in task.ahead),
        reach=unit.length * task.reach,
        tolerance=unit.length * task.tolerance,
    )


def observe(x: np.ndarray, flat: np.ndarray) -> np.ndarray:
    """Return what a policy sees, in body axes, so that the heading of the track does not matter.

    | entries | meaning | unit |
    |---|---|---|
    | 0:3 | reference minus position | m |
    | 3:6 | reference minus velocity | m/s |
    | 6:9 | velocity | m/s |
    | 9:15 | first two columns of R_WB | 1 |
    | 15:18 | body rates | rad/s |
    | 18: | reference at each time ahead minus the reference now | m |

    Attitude by two columns of R_WB has no jump. Source: Zhou et al. 2019, 6D representation.

    Args:
        x: (13,) state.
        flat: (5, 1 + n, 3) reference in W, now and at the times ahead.
    """
    R = attitude.rotation_matrix(x[3:7])
    p_ref, v_ref = flat[0, 0], flat[1, 0]
    in_W = np.vstack([p_ref - x[0:3], v_ref - x[7:10], x[7:10], flat[0, 1:] - p_ref])
    in_B = in_W @ R
    return np.concatenate([in_B[:3].ravel(), R[:, 0], R[:, 1], x[10:13], in_B[3:].ravel()])


def command_span(vehicle: Vehicle) -> np.ndarray:
    """Return the command (4,) that an action of one adds to hover thrust [N, N·m].

    Each is the largest that the rotors can give alone, either way, while they carry the vehicle: an action along one
    axis is never saturated.
    """
    hover = vehicle.unmixer @ vehicle.hover_input
    spare = np.minimum(hover, vehicle.max_rotor_thrust - hover)
    return 1.0 / np.max(np.abs(vehicle.unmixer) / spare[:, None], axis=0)
