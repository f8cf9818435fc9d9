"""In-memory flight log that every reader returns and every method takes."""

import dataclasses as dc
from typing import Any

import numpy as np

from np_drake.checks import require
from np_drake.files.notebook import data_frame, html_table
from np_drake.finding import Finding
from np_drake.vehicle.rotor_layout import RotorLayout
from np_drake.vehicle.vehicle import PowerMap, ThrottleMap

MOST_NOTES = 5  # that a notebook shows
COLUMNS: dict[str, tuple[str, ...]] = {  # field of FlightLog: columns of the file
    "t": ("t",),
    "p": ("px", "py", "pz"),
    "q": ("qw", "qx", "qy", "qz"),
    "v": ("vx", "vy", "vz"),
    "w": ("wx", "wy", "wz"),
    "a": ("ax", "ay", "az"),
    "al": ("alx", "aly", "alz"),
    "u": ("thrust", "tx", "ty", "tz"),
    "rotor": ("rotor1", "rotor2", "rotor3", "rotor4"),
    "throttles": ("throttle1", "throttle2", "throttle3", "throttle4"),
    "throttle": ("throttle",),
    "voltage": ("voltage",),
    "commanded_rates": ("wx_cmd", "wy_cmd", "wz_cmd"),
    "balance": ("balance1", "balance2", "balance3", "balance4"),
    "bridged": ("bridged",),
}


@dc.dataclass(frozen=True, eq=False)
class Neighbour:
    """Path of a vehicle nearby, on the clock of the flight that it is beside, linear between its
    rows.

    t: (n,) increasing [s].   p: (n, 3) position in W [m].   name: of its log, for messages.
    Two are equal only if they are one object, so that one can be a key.
    """

    t: np.ndarray
    p: np.ndarray
    name: str = "neighbour"

    def __post_init__(self) -> None:
        """Raise ValueError where that is no path."""
        require(
            np.ndim(self.t) == 1 and np.shape(self.p) == (len(self.t), 3) and len(self.t) >= 2,
            f"{self.name}: must have times (n,) and positions (n, 3), two rows at least.",
        )
        require(
            np.isfinite(self.t).all() and np.isfinite(self.p).all() and (np.diff(self.t) > 0).all(),
            f"{self.name}: must have finite positions at finite, increasing times.",
        )

    def at(self, t: np.ndarray | float) -> np.ndarray:
        """Return the position in W at t (...,) [s], (..., 3) [m]; NaN before its first row and
        after its last.
        """
        position = np.stack([np.interp(t, self.t, column) for column in self.p.T], axis=-1)
        inside = (self.t[0] <= np.asarray(t)) & (np.asarray(t) <= self.t[-1])
        return np.where(inside[..., None], position, np.nan)


@dc.dataclass(repr=False)
class FlightLog:
    """One flight in SI units, W z up, quaternions w, x, y, z body to world
    (docs/reference/flight-log.md).

    Row k's command acts from t_k until t_(k+1); a and al are those at t_k with row k's command
    acting.
    t: (n,) [s].
    p, v: (n, 3) position and velocity of the logged point in W [m, m/s].
    q: (n, 4).
    w: (n, 3) body rates [rad/s].
    u: (n, 4) commanded [f_u, tau_m] after saturation [N, N·m].
    a: (n, 3) dv/dt in W without gravity [m/s²].
    al: (n, 3) dw/dt in B [rad/s²].
    rotor: (n, 4) measured rotor speed [rad/s]. throttle: (n, 1) collective or (n, 4) of the rotors,
        normalised, of unknown scale [1].
    voltage: (n,) of the battery [V].
    commanded_rates: (n, 3) body rates that an autopilot was asked for [rad/s].
    balance: (n, 4) input of each rotor over that of all, their root mean square, of inputs that
        were logged too slowly to tell torque [1]; columns as those of `throttle`.
    bridged: (n,) bool, rows that a reader put into gaps; None: none.
    input: what thrust and torque come from: `command` (thrust and torque), `rotor_speed`,
        `thrust_only` (torque is NaN), `normalised` (throttle; thrust and torque by an estimated
        map).
    timing: standard deviation of the time at which a row's command acts [s]; 0 where it is held
        from its row.
    start: time of its recording's clock at t = 0; logs of clocks that agree are aligned by it [s].
    neighbours: vehicles that flew nearby, on the clock of t.
    throttle_map: by which u comes from throttle, as `ThrottleMap`; None: from another input.
    layout: where the rotors of `rotor`, `throttle` and `balance` are; None: in the order of the
        vehicle file.
    motors: names of these rotors in the log that was recorded; empty: not known.
    lacks: what was not logged and is integrated: `attitude`, `velocity`, `height` (position); keys
        of `library.REQUIREMENTS`. The specific force in B, R^T (a + g), is that of the
        accelerometer all the same.
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
    commanded_rates: np.ndarray | None = None
    balance: np.ndarray | None = None
    bridged: np.ndarray | None = None
    name: str = "flight"  # for messages and tables
    input: str = "command"  # command | rotor_speed | thrust_only | normalised
    timing: float = 0.0
    layout: RotorLayout | None = None
    motors: tuple[str, ...] = ()
    lacks: tuple[str, ...] = ()
    start: float = 0.0
    neighbours: tuple[Neighbour, ...] = ()
    throttle_map: ThrottleMap | PowerMap | None = None
    # what a reader derived, differentiated or repaired
    findings: list[Finding] = dc.field(default_factory=list)

    def __len__(self) -> int:
        return len(self.t)

    @property
    def notes(self) -> list[str]:
        """Lines of the findings, for people."""
        return list(map(str, self.findings))

    @property
    def x(self) -> np.ndarray:
        """State [p_WB, q_WB, v_WB, w_WB_B], (n, 13)."""
        return np.concatenate([self.p, self.q, self.v, self.w], axis=1)

    @property
    def in_gap(self) -> np.ndarray:
        """Rows (n,) that a reader put into gaps."""
        return np.zeros(len(self), bool) if self.bridged is None else self.bridged

    @property
    def step(self) -> float:
        """Median sampling interval [s]."""
        return float(np.median(np.diff(self.t)))

    def __repr__(self) -> str:
        """Return name, length, rate and input in a line."""
        span = float(self.t[-1] - self.t[0]) if len(self) else 0.0
        rate = f" at {1 / self.step:.0f} Hz" if len(self) > 1 else ""
        lacks = f", without {', '.join(self.lacks)}" if self.lacks else ""
        return (
            f"FlightLog({self.name!r}: {len(self)} rows, {span:.1f} s{rate}, input "
            f"{self.input}{lacks})"
        )

    def _repr_html_(self) -> str:
        """Return what a notebook shows: ranges of the quantities, and the notes of the reader."""
        ranges = [
            ("height [m]", None if "height" in self.lacks else self.p[:, 2]),
            ("speed [m/s]", None if "velocity" in self.lacks else np.linalg.norm(self.v, axis=1)),
            ("body rate [rad/s]", np.linalg.norm(self.w, axis=1)),
            ("thrust [N]", self.u[:, 0]),
            ("rotor speed [rad/s]", self.rotor),
            ("voltage [V]", self.voltage),
        ]
        rows = [
            (n, f"{np.nanmin(v):.3g} to {np.nanmax(v):.3g}")
            for n, v in ranges
            if v is not None and np.isfinite(v).any()
        ]
        return html_table(repr(self), ("", "range"), rows, self.notes[:MOST_NOTES])

    def columns(self) -> dict[str, np.ndarray]:
        """Return columns (n,) by the names of a flight log's file
        (docs/reference/flight-log.md).
        """
        columns: dict[str, np.ndarray] = {}
        for field, names in COLUMNS.items():
            value = getattr(self, "throttle" if field == "throttles" else field)
            if value is not None and np.size(value) == len(self) * len(names):
                columns |= dict(
                    zip(names, np.reshape(value, (-1, len(names))).astype(float).T, strict=True)
                )
        return columns

    def to_dataframe(self) -> Any:
        """Return the log as a pandas DataFrame, with the times as its index and the columns of its
        file.
        """
        return data_frame(self.columns(), index="t")

    def plot(self) -> Any:
        """Return a Figure of the track from above, and of position, speed and thrust against
        time.
        """
        from np_drake.files.figure_file import PALETTE, new_mosaic

        panels = {
            "height": ("z [m]", self.p[:, 2]),
            "speed": ("speed [m/s]", np.linalg.norm(self.v, axis=1)),
            "thrust": ("thrust [N]", self.u[:, 0]),
        }
        figure, axes = new_mosaic([["track", name] for name in panels], width=10.0, height=4.8)
        axes["track"].plot(self.p[:, 0], self.p[:, 1], color=PALETTE[0], linewidth=1.2)
        axes["track"].set(
            xlabel="x [m]", ylabel="y [m]", title=self.name, aspect="equal", adjustable="datalim"
        )
        for name, (label, values) in panels.items():
            axes[name].plot(self.t, values, color=PALETTE[0], linewidth=1.0)
            axes[name].set(ylabel=label)
            axes[name].margins(x=0)
        axes[name].set(xlabel="time [s]")
        for ax in axes.values():
            ax.grid(alpha=0.3)
        return figure

    def rows(self, start: int, stop: int) -> "FlightLog":
        """Return a part of the flight as a separate log.

        Args:
            start: first row.
            stop: the one after the last.
        """
        return self.taken(slice(start, stop))

    def taken(self, rows: slice | np.ndarray) -> "FlightLog":
        """Return a log of these rows alone."""
        cut: dict[str, Any] = {
            name: value[rows] for name, value in vars(self).items() if isinstance(value, np.ndarray)
        }
        return dc.replace(self, **cut, findings=list(self.findings))
