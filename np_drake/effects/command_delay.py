"""Effect `command_delay`: commands that arrive late."""

import dataclasses as dc

import numpy as np

from np_drake.effects.base import ActuatorEffect, Parameter
from np_drake.vehicle import Vehicle


@dc.dataclass(frozen=True)
class CommandDelay(ActuatorEffect):
    """Pure dead time, f(t) = f_command(t - delay).

    Source: own choice: radio, bus and ESC.
    """

    delay: float = 0.02  # [s]

    named = "a command delay"
    drawn = (0.004, 0.04)
    bench_check = "log rotor speed, and compare it with the command"
    excited_by = "sharp doublets, and a log of rotor speed"
    told_from = {"clock_offset": "log rotor speed: a delay shows there, a clock offset does not"}
    requires = ("commands",)
    shifts_commands = True
    pure_delay = True
    linear = False
    parameters = (
        Parameter(
            "delay",
            "s",
            0.0,
            0.0,
            0.3,
            0.02,
            departure="commands act {size} later|commands act {size} earlier",
        ),
    )
    turns_rotor = True

    @classmethod
    def grid(cls, vehicle: Vehicle) -> list[dict[str, float]]:
        """Return the delays at which a search linearises it."""
        return [{"delay": float(v)} for v in np.geomspace(0.003, 0.06, 10)]

    @property
    def dead_time(self) -> float:
        """Time by which commands are held back [s]."""
        return self.delay

    def time_shift(self, vehicle: Vehicle) -> float:
        """Return the time by which commands act later [s]."""
        return self.delay

    def thrust(
        self, vehicle: Vehicle, state: np.ndarray, command: np.ndarray, t: np.ndarray | float = 0.0
    ) -> np.ndarray:
        """Return the thrusts (..., 4) [N] of a command that is delayed already by `dead_time`."""
        return command

    def respond(self, vehicle: Vehicle, t: np.ndarray, command: np.ndarray) -> np.ndarray:
        """Return the mean thrusts (n, 4) [N], exact.

        Every interval holds the ends of two commands; the first command is held before.
        """
        if len(t) < 2:
            return command
        rows = self.delay * (len(t) - 1) / (t[-1] - t[0])
        full = int(np.floor(rows))
        part = rows - full
        k = np.arange(len(t)) - full
        late, later = (np.clip(i, 0, len(t) - 1) for i in (k, k - 1))
        return (1.0 - part) * command[late] + part * command[later]
