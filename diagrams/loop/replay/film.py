"""Animation of a Meshcat scene, frame by frame."""

import numpy as np
from pydrake.geometry import Meshcat, MeshcatAnimation
from pydrake.math import RigidTransform

from diagrams.loop.replay.scene import SHORTEST, along, pose, tether_pose

FRAME_RATE = 25.0  # [1/s]
FOREVER = 10_000  # times that a page plays


def frames(t: np.ndarray) -> np.ndarray:
    """Return the rows of times t (n,) [s] that are shown, `FRAME_RATE` a second from the first
    on.
    """
    count = int((t[-1] - t[0]) * FRAME_RATE + 1e-6) + 1
    rows = np.searchsorted(t, t[0] + np.arange(count) / FRAME_RATE - 0.5 * np.median(np.diff(t)))
    return np.minimum(rows, len(t) - 1)


class Film:
    """Animation that is written frame by frame."""

    def __init__(self) -> None:
        self.animation = MeshcatAnimation(FRAME_RATE)
        self.animation.set_loop_mode(MeshcatAnimation.LoopMode.kLoopRepeat)
        self.animation.set_repetitions(FOREVER)

    def quadrotor(self, frame: int, path: str, x: np.ndarray) -> None:
        """Show a quadrotor.

        Args:
            x: (13,) its state.
        """
        self.animation.SetTransform(frame, path, pose(x))

    def payload(
        self, frame: int, x: np.ndarray, hook: np.ndarray, p_WP: np.ndarray, path: str = ""
    ) -> None:
        """Show a payload on its tether.

        Args:
            x: (13,) state of the vehicle.
            hook: (3,) where the tether begins, in B [m].
            p_WP: (3,) position of the payload in W [m].
        """
        self.animation.SetTransform(frame, f"{path}payload", RigidTransform(p_WP))
        self.bar(frame, f"{path}tether", *tether_pose(x, hook, p_WP))

    def arrow(self, frame: int, path: str, start: np.ndarray, vector: np.ndarray) -> None:
        """Show an arrow.

        Args:
            start: (3,) of the arrow, in W [m].
            vector: (3,) from there to its tip, in W [m].
        """
        self.bar(frame, path, along(start, vector), max(float(np.linalg.norm(vector)), SHORTEST))

    def bar(self, frame: int, path: str, X_W: RigidTransform, length: float) -> None:
        """Show an object of unit length along its z axis.

        Args:
            length: at which it is shown [m].
        """
        self.animation.SetTransform(frame, path, X_W)
        self.animation.SetProperty(frame, path, "scale", [1.0, 1.0, length])

    def visible(self, frame: int, path: str, shown: bool) -> None:
        """Show or hide an object."""
        self.animation.SetProperty(frame, path, "visible", shown)

    def show(self, meshcat: Meshcat) -> None:
        """Give the animation to a scene."""
        meshcat.SetAnimation(self.animation)
