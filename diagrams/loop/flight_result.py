"""Simulation of a flight, and its result: log, truth and metrics."""

import dataclasses as dc
from collections.abc import Callable
from functools import cached_property
from typing import Any

import numpy as np
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import Diagram

from diagrams.batch.run import FailedRun, one_line, require
from diagrams.loop.flight import ARENA, FlightConfig, flown_by
from diagrams.loop.flight_diagram import firmware_of, make_flight_diagram, make_simulator, recorded
from diagrams.loop.own_controller import Factory, is_own
from diagrams.loop.reality import REAL_VEHICLE
from np_drake import attitude, metrics, rigid_body
from np_drake.files.notebook import data_frame, html_table
from np_drake.files.number_text import measure
from np_drake.flight_log import COLUMNS, FlightLog
from np_drake.logs.clock import shift_state
from np_drake.mpc.problem import MpcStatus
from np_drake.references.waypoints import nearest
from np_drake.rotor_input import acting_command
from np_drake.training_data.actuator_timing import delayed

Signals = dict[str, np.ndarray]  # in the form of `Recorder.read`
WRENCH = ("fx", "fy", "fz", "taux", "tauy", "tauz")  # columns of a wrench [N, N·m]
# Height below which a vehicle counts as lost, and a payload is warned of: the simulator has no
# ground, flights do [m].
GROUND = 0.0
MOST_TOLD = 5  # waypoints in a sentence


class LostVehicle(FailedRun):
    """Early end of a flight.

    signals: until then, in the form of `Recorder.read`.
    """

    signals: Signals


@dc.dataclass(repr=False)
class FlightResult:
    """One simulated flight.

    signals: in the form of `Recorder.read`; the truth among them is for tests and plots only.
    """

    config: FlightConfig
    seed: int  # of the noise
    signals: Signals
    blackbox: bytes = b""  # log that the autopilot's firmware itself has written; empty without one

    def __repr__(self) -> str:
        """Return experiment, controller, seed and errors in a line."""
        m = self.metrics()
        errors = f"E_xy {100 * m['E_xy']:.2f} cm, E_z {100 * m['E_z']:.2f} cm"
        return f"FlightResult({self.config.name} with {self.label}, seed {self.seed}: {errors})"

    def _repr_html_(self) -> str:
        """Return what a notebook shows: the metrics in a short table, and warnings."""
        m = self.metrics()
        rows = [
            *((name, f"{100 * m[name]:.2f} cm") for name in ("E_xy", "E_z")),
            ("median time of a solve", f"{m['solve_ms']['median']:.2f} ms"),
            ("failed", str(m["solve_failures"])),
        ]
        title = f"{self.config.name} with {self.label}, seed {self.seed}: {self.config.end:g} s"
        return html_table(title, (), rows, self.warnings())

    def to_dataframe(self) -> Any:
        """Return the flight as a pandas DataFrame with the times as its index.

        It holds the columns of the log, the reference (`px_ref` …), and of the truth state
        (`px_true` …) and residual wrench (`fx_true` …).
        Raises: ImportError: where pandas is not installed.
        """
        s = self.signals
        columns = dict(self._rows().columns())
        state = [name for field in ("p", "q", "v", "w") for name in COLUMNS[field]]
        for end, names, values in (
            ("ref", COLUMNS["p"], s["p_ref"]),
            ("true", state, s["x_true"]),
            ("true", WRENCH, self.chi_true),
            ("label", WRENCH, s.get("label")),
            ("predicted", WRENCH, s.get("chi_hat")),
        ):
            if values is not None:
                columns |= {f"{name}_{end}": values[:, k] for k, name in enumerate(names)}
        return data_frame(columns, index="t")

    def plot(self, what: str = "track") -> Any:
        """Return a Figure: `track` from above and height, `errors` against time, or the residual
        `wrench`.

        Raises: ValueError: on another word.
        """
        from diagrams.loop import flight_figures as figures

        require(
            what in ("track", "errors", "wrench"),
            f"plot: must be one of track, errors, wrench; got {what!r}.",
        )
        if what == "wrench":
            return figures.wrench(self)
        draw = figures.plane_track if what == "track" else figures.errors
        return draw([self], self.title)

    @property
    def label(self) -> str:
        """Name of the controller, such as `np` or `nominal + total mass`."""
        added = " + total mass" if self.config.controller.extra_mass else ""
        return f"{self.config.controller.name}{added}"

    @property
    def title(self) -> str:
        """Experiment, controller and seed, above figures and replay."""
        return f"{self.config.name} · {self.label} · seed {self.seed}"

    def log(self) -> FlightLog:
        """Return what the vehicle itself recorded (docs/reference/flight-log.md)."""
        log = self._rows()
        config = self.config
        shift = config.reality.clock_shift + config.vehicle.calibration.clock_offset
        return shift_state(log, shift) if shift else log

    def _rows(self) -> FlightLog:
        """Return the log by the clock of the commands."""
        s = self.signals
        x = s["x"]
        a = s["acceleration"]
        return FlightLog(
            t=s["t"],
            p=x[:, 0:3],
            q=x[:, 3:7],
            v=x[:, 7:10],
            w=x[:, 10:13],
            u=self.config.vehicle.saturate(s["u"]),
            a=a[:, :3],
            al=a[:, 3:],
            rotor=s["rotor_speed"],
            throttle=s.get("motors"),
            commanded_rates=s["rates_thrust"][:, 1:] if "rates_thrust" in s else None,
            name=self.config.name,
        )

    @cached_property
    def scored(self) -> np.ndarray:
        """Whether each row is after the ramp, (n,); all rows of a flight that was stopped before
        its end.
        """
        after = self.signals["t"] >= self.config.reference.lead - 1e-9
        return after if after.any() else ~after

    @property
    def last_lap(self) -> np.ndarray:
        """Rows of the last lap, or the scored rows of a motion that has none, (n,)."""
        rows = np.flatnonzero(self.scored)
        rate = getattr(self.config.motion, "rate", None)
        return (
            rows[-(int(2 * np.pi / rate / self.config.controller.period) + 1) :] if rate else rows
        )

    @cached_property
    def chi_true(self) -> np.ndarray:
        """True wrench (n, 6): eq. (1) inverted from the true motion and the command, for the
        controller's mass.

        The command goes through the delay that the controller believed at the end, and through the
        vehicle file's lag, as in the labels [N, N·m].
        """
        s = self.signals
        x = s["x_true"]
        a = s["acceleration_true"]
        believed = self.config.controller.believed(self.config.vehicle)
        u = acting_command(delayed(self._rows(), self.delay), believed)
        return rigid_body.residual_wrench(
            believed, q=x[:, 3:7], w=x[:, 10:13], a=a[:, :3], al=a[:, 3:], u=u
        )

    @property
    def delay(self) -> float:
        """Delay of commands that the controller believed at the end; 0 where it looks not ahead
        [s].
        """
        return float(self.signals["delay"][-1, 0]) if "delay" in self.signals else 0.0

    @property
    def wrench_label(self) -> np.ndarray | None:
        """Wrench measured from the motion, (n, 6) [N, N·m]; None of a controller that takes
        none.
        """
        return self.signals.get("label")

    @cached_property
    def chi_foreseen(self) -> np.ndarray | None:
        """Wrench that the controller foresaw for each row, (n, 6) [N, N·m]; None without a
        prediction.

        `chi_hat` of a row is that of the time at which its command acts: `delay` later.
        """
        if "chi_hat" not in self.signals:
            return None
        rows = round(self.delay / self.config.controller.period)
        k = np.maximum(np.arange(len(self.signals["t"])) - rows, 0)
        return self.signals["chi_hat"][k]

    @cached_property
    def payload_position(self) -> np.ndarray | None:
        """Position of the payload in W, (n, 3) [m]; None without one."""
        s = self.signals["plant_state"]
        hung = self.config.reality.hung
        if s.shape[1] == 26:  # on a cable: a free body
            return s[:, 11:14]
        if s.shape[1] != 17:
            return None
        sin_x, sin_y = np.sin(s[:, 7:9].T)
        cos_x, cos_y = np.cos(s[:, 7:9].T)
        down = np.stack([-sin_y, sin_x * cos_y, -cos_x * cos_y], axis=1)  # along the rod, in B
        return s[:, 4:7] + attitude.rotate(s[:, :4], hung.hook + hung.length * down)

    @cached_property
    def below_ground(self) -> dict[str, float] | None:
        """The `time` from which the hanging payload is below the ground [s], and its largest
        `depth` [m]; None where it never is.
        """
        if self.payload_position is None:
            return None
        t = self.signals["t"]
        reality = self.config.reality
        cut = min((e.time for e in self.config.events if e.kind == "release"), default=np.inf)
        depth = GROUND + reality.hung.radius - self.payload_position[:, 2]
        rows = np.flatnonzero((depth > 0) & (t > reality.hangs_at) & (t < cut))
        return {"time": t[rows[0]], "depth": depth[rows].max()} if len(rows) else None

    @property
    def flown(self) -> np.ndarray:
        """Flown true positions in W (n, 3) [m]."""
        return self.signals["x_true"][:, :3]

    @cached_property
    def waypoint_distances(self) -> np.ndarray | None:
        """How near the flight came to each waypoint of the track, (k,) [m]; None of a track without
        any.
        """
        points = self.config.reference.waypoints
        return None if points is None else nearest(points, self.flown)

    def warnings(self) -> list[str]:
        """Return a sentence on the waypoints that the flight did not pass, and one on a payload
        below the ground; none where all is well.
        """
        lines = []
        distances = self.waypoint_distances
        within = self.config.reference.within
        if below := self.below_ground:
            lines.append(
                f"the payload of the flight with {self.label} is below the ground from "
                f"{below['time']:.2f} s on, by {measure(below['depth'], 'm')} at most; the "
                "simulator has no ground. Fly higher, or shorten the tether."
            )
        rows = np.flatnonzero([] if distances is None else distances > within)
        if distances is None or not len(rows):
            return lines
        listed = ", ".join(f"{k + 1} ({distances[k]:.2f} m)" for k in rows[:MOST_TOLD])
        more = f" and {len(rows) - MOST_TOLD} more" if len(rows) > MOST_TOLD else ""
        many = "waypoint" if len(rows) == 1 else "waypoints"
        missed = f"the flight with {self.label} does not come within {within:g} m of {many} "
        return [*lines, f"{missed}{listed}{more}."]

    def metrics(self) -> dict:
        """Return the metrics of the scored part, as `--json` writes them."""
        s = self.signals
        rows = self.scored
        status = s["status"][rows, 0]
        result = {
            **metrics.tracking_errors(self.flown[rows], s["p_ref"][rows]),
            "growth": metrics.error_growth(self.flown[rows], s["p_ref"][rows]),
            "solve_ms": metrics.solve_times_ms(s["solve_time"][rows, 0]),
            "solve_failures": int(np.sum(status >= MpcStatus.SQP_FALLBACK)),
            "late_solves": int(np.sum(s["solve_time"][rows, 0] > self.config.controller.period)),
            "fallbacks": int(np.sum(status >= MpcStatus.SHIFTED_PLAN)),
        }
        if self.waypoint_distances is not None:
            result["waypoint_distances"] = self.waypoint_distances.tolist()
        if self.below_ground is not None:
            result["payload_below_ground"] = self.below_ground
        if self.chi_foreseen is not None:
            result["wrench_rmse"] = metrics.wrench_rmse(
                self.chi_foreseen[rows], self.chi_true[rows]
            )
        if "delay" in s:
            result["command_delay"] = self.delay
        return result

    def summary(self) -> dict:
        """Return the `fly` object of `--json` (docs/reference/files.md)."""
        named = {"experiment": self.config.name, "controller": self.label, "seed": self.seed}
        return named | {"metrics": self.metrics()}


def fly(
    config: FlightConfig,
    *,
    seed: int = 0,
    monitor: Callable[[float], None] | None = None,
    tolerance: float = np.inf,
    real_time: bool = False,
    controller: Factory | None = None,
) -> FlightResult:
    """Simulate the experiment and return its result.

    Args:
        config: of the experiment.
        seed: of the noise.
        monitor: called with the flight's time [s] about every second, for progress; of a flight in
            real time at its beginning and twice as often.
        tolerance: distance from the reference beyond which the flight ends, looked at about every
            second [m].
        real_time: whether it is no faster than a clock.
        controller: makes a controller of one's own, in the place of the one that `config` names.
    Raises: LostVehicle: if the integrator gives up, or the vehicle leaves arena or tolerance, or is
        below ground; FailedRun: if a controller of one's own fails; ValueError: if such a
        controller does not fit.
    """
    config = flown_by(config, controller)
    diagram = make_flight_diagram(config, controller=controller)
    firmware = firmware_of(diagram)
    try:
        simulator = make_simulator(diagram, config, seed=seed)
        signals = _advance(simulator, diagram, config, monitor, tolerance, real_time)
        return FlightResult(config, seed, signals, firmware.blackbox() if firmware else b"")
    finally:
        if firmware is not None:
            firmware.close()


def _advance(
    simulator: Simulator,
    diagram: Diagram,
    config: FlightConfig,
    monitor: Callable[[float], None] | None,
    tolerance: float,
    real_time: bool,
) -> Signals:
    """Fly to the end, and return the recorded signals; arguments as of `fly`."""
    context = simulator.get_mutable_context()
    who = config.controller.name
    vehicle = diagram.GetSubsystemByName(REAL_VEHICLE)
    reference = config.motion
    users = is_own(config.controller.kind)

    def lost(why: str) -> LostVehicle:
        error = LostVehicle(f"{config.name}: {why}")
        error.signals = recorded(diagram, context)
        return error

    if real_time and monitor is not None:
        monitor(0.0)
    simulator.set_target_realtime_rate(float(real_time))
    for t in _stops(config, 0.5 if real_time else 1.0):
        try:
            simulator.AdvanceTo(t)
        except RuntimeError as error:
            why = f"the simulation ended before {t:.1f} s: {error}"
            if users and "NaN" in str(error):
                why = f"{who} commanded what is not a number before {t:.1f} s."
            raise lost(why) from error
        except (Exception, SystemExit) as error:
            if not users:
                raise
            when = f"{config.name}: {who} failed at {context.get_time():.2f} s"
            raise FailedRun(f"{when}: {one_line(error)}.") from error
        # where it is to run in real time, time that was lost is not caught up with
        simulator.ResetStatistics()
        p_WB = vehicle.GetOutputPort("x").Eval(vehicle.GetMyContextFromRoot(context))[:3]
        off = np.linalg.norm(p_WB - reference.sample(np.array([t]))[0, 0])
        for holds, why in (
            (np.linalg.norm(p_WB) < ARENA, "lost the vehicle before"),
            (p_WB[2] >= GROUND, "flew into the ground before"),
            (off < tolerance, "was off its reference at"),
        ):
            if not holds:
                raise lost(f"{who} {why} {t:.1f} s.")
        if monitor is not None:
            monitor(min(t, config.end))
    return recorded(diagram, context)


def _stops(config: FlightConfig, period: float) -> list[float]:
    """Return the times at which a flight is looked at, every `period` and at its changes, the last
    of which is its end [s].
    """
    changes = [*(event.time for event in config.events), *config.reality.onsets.values()]
    stops = [t for t in changes if 0 < t < config.end]
    stops += np.arange(period, config.end, period).tolist()
    # Half a period beyond the end: the recorder passes the last row on at the end itself.
    return sorted({*stops, config.end + 0.5 * config.controller.period})
