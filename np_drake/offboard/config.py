"""Limits and times of offboard control."""

import dataclasses as dc

import numpy as np

CLEAR = 0.1  # time in order after which a flight goes on [s]; source: own choice
FASTEST_RATE = 500.0  # of messages [Hz]; source: own choice


@dc.dataclass
class OffboardConfig:
    """What must hold while the vehicle is commanded, and what happens when it does not."""

    system: int = 0  # MAV_SYS_ID of the autopilot; 0: that which is heard first
    rate: float = 100.0  # of what is sent, a whole multiple of the controller's [Hz]
    stale_after: float = 0.1  # age of a state that is too old [s]
    heartbeat_lost: float = 3.0  # time without a heartbeat after which the autopilot is lost [s]
    margin: float = 1.0  # largest distance from the reference [m]
    max_speed: float = 8.0  # of the vehicle [m/s]
    max_tilt: float = 1.2  # of body z from world z [rad]
    max_rate: float = 12.0  # of the body [rad/s]
    max_jump: float = (
        0.3  # of a position from where its velocity led; a message beyond is not taken [m]
    )
    late_solves: int = 5  # in succession that are too many [1]
    settle: float = 1.0  # time in order before the autopilot may hand over [s]
    level: float = 0.5  # longest time of level thrust, after which nothing is sent [s]

    def check(self) -> "OffboardConfig":
        """Return self after checking all values.

        Raises: ValueError: where one is impossible.
        """
        if not 0 <= self.system <= 255:
            raise ValueError(f"offboard: system must be 0 to 255; got {self.system}.")
        for name, value in dc.asdict(self).items():
            if name != "system" and not 0 < value < np.inf:
                raise ValueError(f"offboard: {name} must be positive and finite; got {value}.")
        if not 2 <= self.rate <= FASTEST_RATE:
            raise ValueError(f"offboard: rate must be 2 to {FASTEST_RATE:g} Hz; got {self.rate:g}.")
        if self.level <= CLEAR:
            raise ValueError(f"offboard: level must be more than {CLEAR:g} s; got {self.level:g}.")
        if self.stale_after < 2 / self.rate:
            raise ValueError(
                f"offboard: stale_after must be two periods of {1 / self.rate:g} s at "
                f"least; got {self.stale_after:g}."
            )
        return self
