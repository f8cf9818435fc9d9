"""Rate loop of an autopilot: what it makes of commanded body rates and collective thrust."""

import dataclasses as dc

import numpy as np

SLOWEST = 1.0  # lag beyond which it is in another unit than seconds [s]
GAINS = (0.2, 5.0)  # rate over commanded rate of any loop that flies [1]; source: own choice
FASTEST = 44.0  # rate beyond which it is in another unit than rad/s [rad/s]; source: own choice


@dc.dataclass
class RateLoop:
    """Body rate over its command, on each body axis a first-order lag.

    dw/dt = (gain w_c - w) / lag. Besides the autopilot's controller, the lag holds the motors' and
    the link's.
    """

    lag: list[float] = dc.field(default_factory=lambda: [0.075, 0.075, 0.2])  # time constants [s]
    gain: list[float] = dc.field(
        default_factory=lambda: [1.0, 1.0, 1.0]
    )  # rate over command, at rest [1]
    max_rate: list[float] = dc.field(
        default_factory=lambda: [6.0, 6.0, 3.0]
    )  # that may be commanded [rad/s]

    def check(self) -> "RateLoop":
        """Return self after checking all values.

        Raises: ValueError: where one is impossible.
        """
        for name, least, most, unit in (
            ("lag", 1e-3, SLOWEST, "s"),
            ("gain", *GAINS, "1"),
            ("max_rate", 1e-2, FASTEST, "rad/s"),
        ):
            value = np.array(getattr(self, name), float)
            if value.shape != (3,) or not np.all((value >= least) & (value <= most)):
                raise ValueError(
                    f"rate_loop: {name} must be three numbers from {least:g} to {most:g} "
                    f"[{unit}], one for each body "
                    f"axis; got {getattr(self, name)}."
                )
        return self

    def torque(self, J: np.ndarray, w: np.ndarray, command: np.ndarray) -> np.ndarray:
        """Return the torque (..., 3) by which the loop turns the vehicle, with what its own
        rotation needs [N·m].

        Args:
            J: (3, 3) inertia [kg·m²].
            w: (..., 3) body rates [rad/s].
            command: (..., 3) commanded body rates [rad/s].
        """
        al = (np.array(self.gain) * command - w) / np.array(self.lag)
        return al @ J.T + np.cross(w, w @ J.T)

    def command(self, w: np.ndarray, al: np.ndarray) -> np.ndarray:
        """Return the commanded rates (..., 3) that give an angular acceleration [rad/s].

        Args:
            w: (..., 3) body rates [rad/s].
            al: (..., 3) angular acceleration in body axes [rad/s²].
        """
        return (w + np.array(self.lag) * al) / np.array(self.gain)
