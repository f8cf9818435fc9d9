"""Two clocks that differ: that of the state and that of the commands."""

import dataclasses as dc
from typing import ClassVar

from np_drake.effects.base import Parameter, SensorEffect


@dc.dataclass(frozen=True)
class ClockOffset(SensorEffect):
    """The state columns (p, q, v, w, a, al) of row t are those of t + offset; commands and rotor speed keep time.

    No reading at an instant can show it: `np_drake.logs.clock.shift_state` does it to a log.
    Source: own choice: motion capture and autopilot on clocks of their own.
    """

    offset: float = 0.02  # [s]

    identifier: ClassVar[str] = "clock_offset"
    linear: ClassVar[bool] = False
    corrupts: ClassVar[tuple[str, ...]] = (
        *("px", "py", "pz", "qw", "qx", "qy", "qz", "vx", "vy", "vz", "wx", "wy", "wz"),
        *("ax", "ay", "az", "alx", "aly", "alz"),
    )
    parameters: ClassVar[tuple[Parameter, ...]] = (Parameter("offset", "s", 0.0, -0.3, 0.3, 0.02),)

    @property
    def clock_shift(self) -> float:
        """[s]."""
        return self.offset
