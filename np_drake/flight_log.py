"""In-memory flight log that every reader returns and every method takes."""

import dataclasses as dc
from typing import Any

import numpy as np

from np_drake.rotor_layout import RotorLayout


@dc.dataclass
class FlightLog:
    """One flight in SI units, W z up, quaternions w, x, y, z body to world (docs/reference/flight-log.md).

    Row k's command acts from t_k until t_(k+1); a and al are those at t_k with row k's command acting.
    t: (n,) [s].   p, v: (n, 3) position and velocity of the logged point in W [m, m/s].   q: (n, 4).   w: (n, 3)
    body rates [rad/s].   u: (n, 4) commanded [f_u, tau_m] after saturation [N, N·m].   a: (n, 3) dv/dt in W
    without gravity [m/s²].   al: (n, 3) dw/dt in B [rad/s²].   rotor: (n, 4) measured rotor speed [rad/s].
    throttle: (n, 1) collective or (n, 4) of the rotors, normalised, of unknown scale [1].   voltage: (n,) of the
    battery [V].   bridged: (n,) bool, rows that a reader put into gaps; None: none.
    input: what thrust and torque come from: `command` (thrust and torque), `rotor_speed`, `thrust_only` (torque is
    NaN), `normalised` (throttle; thrust and torque by an estimated map).
    timing: standard deviation of the time at which a row's command acts [s]; 0 where it is held from its row.
    layout: where the rotors of `rotor` and `throttle` are; None: in the order of the vehicle file.
    lacks: what was not logged and is integrated: `height` (position), `velocity`; keys of `library.REQUIREMENTS`.
    """

    t: np.ndarray
    p: np.ndarray
    q: np.ndarray
    v: np.ndarray
    w: np.ndarray
    u: np.ndarray
    a: np.ndarray | None = None
    al: np.ndarray | None = None
    rotor: np.ndarray | None = None
    throttle: np.ndarray | None = None
    voltage: np.ndarray | None = None
    bridged: np.ndarray | None = None
    name: str = "flight"  # for messages and tables
    input: str = "command"  # command | rotor_speed | thrust_only | normalised
    timing: float = 0.0
    layout: RotorLayout | None = None
    lacks: tuple[str, ...] = ()
    notes: list[str] = dc.field(default_factory=list)  # what a reader derived, differentiated or repaired

    def __len__(self) -> int:
        return len(self.t)

    @property
    def x(self) -> np.ndarray:
        """State [p_WB, q_WB, v_WB, w_WB_B], (n, 13)."""
        return np.concatenate([self.p, self.q, self.v, self.w], axis=1)

    @property
    def step(self) -> float:
        """Median sampling interval [s]."""
        return float(np.median(np.diff(self.t)))

    def rows(self, start: int, stop: int) -> "FlightLog":
        """Return a part of the flight as a separate log.

        Args:
            start: first row.
            stop: the one after the last.
        """
        cut: dict[str, Any] = {
            name: value[start:stop] for name, value in vars(self).items() if isinstance(value, np.ndarray)
        }
        return dc.replace(self, **cut, notes=list(self.notes))
