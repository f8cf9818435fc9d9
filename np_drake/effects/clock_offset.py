"""Effect `clock_offset`: different clocks of the state and of the commands."""

import dataclasses as dc

import numpy as np

from np_drake.effects.base import Parameter, SensorEffect
from np_drake.vehicle import Vehicle


@dc.dataclass(frozen=True)
class ClockOffset(SensorEffect):
    """Clock offset of the state: the columns p, q, v, w, a, al of row t are those of t + offset.

    Commands and rotor speed keep time. No reading at an instant can show it:
    `np_drake.logs.clock.shift_state` applies it to a log.
    Source: own choice: motion capture and autopilot on separate clocks.
    """

    offset: float = 0.02  # [s]

    named = "a clock offset"
    drawn = (0.003, 0.06)
    either_sign = True
    bench_check = "synchronise the clocks of state and command"
    excited_by = "sharp doublets"
    requires = ("commands", "velocity")
    shifts_commands = True
    pure_delay = True
    linear = False
    corrupts = (
        "px",
        "py",
        "pz",
        "qw",
        "qx",
        "qy",
        "qz",
        "vx",
        "vy",
        "vz",
        "wx",
        "wy",
        "wz",
        "ax",
        "ay",
        "az",
        "alx",
        "aly",
        "alz",
    )
    parameters = (
        Parameter(
            "offset",
            "s",
            0.0,
            0.0,
            0.3,
            0.02,
            departure=(
                "motion logged {size} before the commands|motion logged {size} behind the commands"
            ),
        ),
    )

    @classmethod
    def grid(cls, vehicle: Vehicle) -> list[dict[str, float]]:
        """Return the offsets; the other way it is a delay of the commands, at which a search
        linearises it.
        """
        return [{"offset": float(v)} for v in np.geomspace(0.003, 0.06, 10)]

    def time_shift(self, vehicle: Vehicle) -> float:
        """Return the time by which commands act later on what the state columns show [s]."""
        return -self.offset

    @property
    def clock_shift(self) -> float:
        """Time by which the state columns were taken later than their row's time [s]."""
        return self.offset
