"""Simulation of a flight, and its result: log, truth and metrics."""

import dataclasses as dc
import tempfile
from collections.abc import Callable
from functools import cached_property
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from pydrake.systems.analysis import ApplySimulatorConfig, Simulator
from pydrake.systems.framework import Context, Diagram

from diagrams.batch.failed_run import FailedRun, one_line
from diagrams.loop.autopilots import firmware_of
from diagrams.loop.flight import ARENA, FlightConfig, flown_by
from diagrams.loop.flight_diagram import make_flight_diagram, recorded, set_initial_state
from diagrams.loop.own_controller import Factory, is_own
from diagrams.loop.real_vehicle import DRAKE, REAL_VEHICLE, RealVehicle
from diagrams.loop.track_limits import missed
from np_drake import metrics, rigid_body
from np_drake.files.notebook import data_frame, flattened, html_table
from np_drake.flight_log import COLUMNS, FlightLog
from np_drake.logs.clock import shift_state
from np_drake.mpc.problem import MpcStatus
from np_drake.references.waypoints import nearest
from np_drake.rotor_input import acting_command
from np_drake.training_data.actuator_timing import delayed

WRENCH = ("fx", "fy", "fz", "taux", "tauy", "tauz")  # columns of a wrench [N, N·m]
LEARNED_WRENCHES = (
    ("label", "label"),
    ("chi_hat", "predicted"),
)  # signals of a wrench, and the ends of their columns
GROUND = (
    0.0  # height below which a vehicle counts as lost: the simulator has no ground, flights do [m]
)


class LostVehicle(FailedRun):
    """Early end of a flight.

    signals: until then, in the form of `Recorder.read`.
    """

    signals: dict[str, np.ndarray]


class Watch(Protocol):
    """Viewer that looks at a flight while it is simulated, may push the vehicle, and may end the
    flight.

    period: time between two looks [s].
    rate: real-time rate at which the flight runs; 0 for as fast as possible [1].
    """

    period: float
    rate: float

    def begin(self, diagram: Diagram, context: Context) -> None:
        """See the flight before it begins.

        Args:
            diagram: of `make_flight_diagram`.
            context: its root context.
        """

    def look(self, context: Context) -> bool:
        """See the flight, and return whether it goes on."""


def simulate(
    config: FlightConfig,
    *,
    seed: int,
    monitor: Callable[[float], None] | None = None,
    tolerance: float = np.inf,
    watch: Watch | None = None,
    real: RealVehicle = DRAKE,
    controller: Factory | None = None,
    blackbox: Path | None = None,
) -> dict[str, np.ndarray]:
    """Simulate the experiment and return the recorded signals (see `Recorder.read`).

    Args:
        config: of the experiment.
        seed: of the noise.
        monitor: called with the flight's time [s] about every second, for progress.
        tolerance: distance from the reference beyond which the flight ends, looked at about every
            second [m].
        watch: looks at the flight, sets its pace and may end it early.
        real: makes the vehicle that flies.
        controller: makes a controller of one's own, in the place of the one that `config` names.
        blackbox: file to which an autopilot's own log goes, where it writes one.
    Raises: LostVehicle: if the integrator gives up, or the vehicle leaves arena or tolerance, or is
        below ground;
    FailedRun: if a controller of one's own fails; ValueError: on what `real` cannot do, or if such
        a controller
    does not fit.
    """
    config = flown_by(config, controller)
    diagram = make_flight_diagram(
        config, pushed=watch is not None, real=real, controller=controller
    )
    firmware = firmware_of(diagram)
    try:
        signals = _advance(
            diagram, config, seed=seed, monitor=monitor, tolerance=tolerance, watch=watch, real=real
        )
        if firmware is not None and blackbox is not None:
            firmware.keep_blackbox(blackbox)
        return signals
    finally:
        if firmware is not None:
            firmware.close()


def _advance(
    diagram: Diagram, config: FlightConfig, *, seed, monitor, tolerance, watch, real
) -> dict[str, np.ndarray]:
    """Fly the diagram to its end; arguments as of `simulate`."""
    simulator = Simulator(diagram)
    ApplySimulatorConfig(config.simulator, simulator)
    context = simulator.get_mutable_context()
    set_initial_state(diagram, context, config, seed=seed, real=real)
    vehicle, reference = diagram.GetSubsystemByName(REAL_VEHICLE), config.motion

    def lost(why: str) -> LostVehicle:
        error = LostVehicle(f"{config.name}: {why}")
        error.signals = recorded(diagram, context)
        return error

    if watch is not None:
        simulator.set_target_realtime_rate(watch.rate)
        watch.begin(diagram, context)
    for t in _stops(config, watch):
        try:
            simulator.AdvanceTo(t)
        except RuntimeError as error:
            if is_own(config.controller.kind) and "NaN" in str(error):
                raise lost(
                    f"{config.controller.name} commanded what is not a number before {t:.1f} s."
                ) from error
            raise lost(f"the simulation ended before {t:.1f} s: {error}") from error
        except Exception as error:
            if not is_own(config.controller.kind):
                raise
            who = f"{config.name}: {config.controller.name}"
            raise FailedRun(
                f"{who} failed at {context.get_time():.2f} s: {one_line(error)}."
            ) from error
        # where it is to run in real time, time that was lost is not caught up with
        simulator.ResetStatistics()
        p_WB = vehicle.GetOutputPort("x").Eval(vehicle.GetMyContextFromRoot(context))[:3]
        if not np.linalg.norm(p_WB) < ARENA:
            raise lost(f"{config.controller.name} lost the vehicle before {t:.1f} s.")
        if p_WB[2] < GROUND:
            raise lost(f"{config.controller.name} flew into the ground before {t:.1f} s.")
        if not np.linalg.norm(p_WB - reference.sample(np.array([t]))[0, 0]) < tolerance:
            raise lost(f"{config.controller.name} was off its reference at {t:.1f} s.")
        if monitor is not None:
            monitor(min(t, config.end))
        if watch is not None and not watch.look(context):
            break
    return recorded(diagram, context)


def _stops(config: FlightConfig, watch: Watch | None) -> list[float]:
    """Return the times at which a flight is looked at, the last of which is its end [s]."""
    looks = [] if watch is None else np.arange(watch.period, config.end, watch.period).tolist()
    changes = [*(event.time for event in config.events), *config.reality.onsets.values()]
    # Half a period beyond the end: the recorder passes the last row on at the end itself.
    end = config.end + 0.5 * config.controller.period
    seconds = np.arange(1.0, config.end, 1.0).tolist()
    return sorted({*seconds, *looks, *(t for t in changes if 0 < t < config.end), end})


@dc.dataclass(repr=False)
class FlightResult:
    """One simulated flight.

    signals: in the form of `Recorder.read`; the truth among them is for tests and plots only.
    """

    config: FlightConfig
    seed: int  # of the noise
    signals: dict[str, np.ndarray]
    blackbox: bytes = b""  # log that the autopilot's firmware itself has written; empty without one

    def __repr__(self) -> str:
        """Return experiment, controller, seed and errors in a line."""
        m = self.metrics()
        errors = f"E_xy {100 * m['E_xy']:.2f} cm, E_z {100 * m['E_z']:.2f} cm"
        return f"FlightResult({self.config.name} with {self.label}, seed {self.seed}: {errors})"

    def _repr_html_(self) -> str:
        """Return what a notebook shows: the metrics in a short table, and warnings."""
        m = self.metrics()
        rows = [(name, f"{100 * m[name]:.2f} cm") for name in ("E_xy", "E_z")]
        if "payload" in m:
            rows += [
                (f"payload {name}", f"{100 * m['payload'][name]:.2f} cm")
                for name in ("E_xy", "E_z")
            ]
        rows += [
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
        state = [name for field in ("p", "q", "v", "w") for name in COLUMNS[field]]
        names = {
            "p_ref": COLUMNS["p"],
            "x_true": state,
            "chi_true": WRENCH,
            "label": WRENCH,
            "chi_hat": WRENCH,
        }
        known = {**self.signals, "chi_true": self.chi_true}
        more: dict[str, np.ndarray] = {}
        for signal, end in (
            ("p_ref", "ref"),
            ("x_true", "true"),
            ("chi_true", "true"),
            *LEARNED_WRENCHES,
        ):
            more |= {
                f"{name}_{end}": v for name, v in flattened({signal: names[signal]}, known).items()
            }
        return data_frame({**self._rows().columns(), **more}, index="t")

    def plot(self, what: str = "track") -> Any:
        """Return a Figure: `track` from above and height, `errors` against time, or the residual
        `wrench`.

        Raises: ValueError: on another word.
        """
        from diagrams.loop import flight_figures

        if what == "wrench":
            return flight_figures.wrench(self)
        drawn = {"track": flight_figures.plane_track, "errors": flight_figures.errors}
        if what not in drawn:
            raise ValueError(f"plot: must be one of track, errors, wrench; got {what!r}.")
        return drawn[what]([self], self.title)

    @property
    def label(self) -> str:
        """Name of the controller, such as `np` or `nominal + total mass`."""
        told = " + total mass" if self.config.controller.extra_mass else ""
        return f"{self.config.controller.name}{told}"

    @property
    def title(self) -> str:
        """Experiment, controller and seed, above figures and replay."""
        return f"{self.config.name} · {self.label} · seed {self.seed}"

    def log(self) -> FlightLog:
        """Return what the vehicle itself recorded (docs/reference/flight-log.md)."""
        log, config = self._rows(), self.config
        shift = config.reality.clock_shift + config.vehicle.calibration.clock_offset
        return shift_state(log, shift) if shift else log

    def _rows(self) -> FlightLog:
        """Return the log by the clock of the commands."""
        s = self.signals
        x, a = s["x"], s["acceleration"]
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
        rate = getattr(self.config.track, "rate", None)
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
        x, a = s["x_true"], s["acceleration_true"]
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
        """Position of a payload on a cable, in W, (n, 3) [m]; None without one."""
        s = self.signals["plant_state"]
        return s[:, 11:14] if s.shape[1] == 26 else None

    @cached_property
    def followed(self) -> np.ndarray:
        """Position of what is to follow the track, vehicle or payload, in W (n, 3) [m]."""
        hung = self.payload_position if self.config.follows_payload else None
        return self.signals["x_true"][:, :3] if hung is None else hung

    @cached_property
    def wanted(self) -> np.ndarray:
        """Position of the track, in W (n, 3) [m]."""
        if self.config.follows_payload:
            return self.config.track.sample(self.signals["t"])[0]
        return self.signals["p_ref"]

    @cached_property
    def waypoint_distances(self) -> np.ndarray | None:
        """How near the flight came to each waypoint of the track, (k,) [m]; None of a track without
        any.
        """
        points = self.config.reference.waypoints
        return None if points is None else nearest(points, self.followed)

    def warnings(self) -> list[str]:
        """Return sentences on waypoints that track or flight do not pass."""
        flown = self.waypoint_distances
        found = (
            []
            if flown is None
            else missed(flown, self.config.reference.within, f"the flight with {self.label}")
        )
        return [*self.config.warnings(), *found]

    def metrics(self) -> dict:
        """Return the metrics of the scored part, as `--json` writes them."""
        s, rows = self.signals, self.scored
        status = s["status"][rows, 0]
        result = {
            **metrics.tracking_errors(s["x_true"][rows, :3], s["p_ref"][rows]),
            "growth": metrics.error_growth(s["x_true"][rows, :3], s["p_ref"][rows]),
            "solve_ms": metrics.solve_times_ms(s["solve_time"][rows, 0]),
            "solve_failures": int(np.sum(status >= MpcStatus.SQP_FALLBACK)),
            "late_solves": int(np.sum(s["solve_time"][rows, 0] > self.config.controller.period)),
            "fallbacks": int(np.sum(status >= MpcStatus.SHIFTED_PLAN)),
        }
        if self.config.follows_payload:
            result["payload"] = metrics.tracking_errors(self.followed[rows], self.wanted[rows])
        if self.waypoint_distances is not None:
            result["waypoint_distances"] = self.waypoint_distances.tolist()
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
    watch: Watch | None = None,
    real: RealVehicle = DRAKE,
    controller: Factory | None = None,
) -> FlightResult:
    """Simulate the experiment and return its result.

    Args:
        config: of the experiment.
        seed: of the noise.
        monitor: called with the flight's time [s], see `simulate`.
        watch: looks at the flight, sets its pace and may end it early.
        real: makes the vehicle that flies.
        controller: makes a controller of one's own, in the place of the one that `config` names.
    """
    how: dict[str, Any] = {
        "monitor": monitor,
        "watch": watch,
        "real": real,
        "controller": controller,
    }
    if config.autopilot.kind != "betaflight":
        return FlightResult(flown_by(config, controller), seed, simulate(config, seed=seed, **how))
    with tempfile.TemporaryDirectory() as folder:
        log = Path(folder) / "blackbox"
        signals = simulate(config, seed=seed, blackbox=log, **how)
        own = log.read_bytes() if log.is_file() else b""
        return FlightResult(flown_by(config, controller), seed, signals, own)
