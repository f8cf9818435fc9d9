"""Study `node`: faults of link, state, solver and processes while a node flies."""

import dataclasses as dc
from typing import Annotated, Any

import numpy as np
from typer import Option

from diagrams.batch.campaign import Case
from diagrams.batch.run import Report, Run, Table, failures, results
from diagrams.loop.experiments import load_experiment
from diagrams.loop.flight import FlightConfig
from diagrams.offboard.beside import flown_beside
from diagrams.offboard.faults import KINDS, SOLVER, STATE_LOST, Fault, FaultyAutopilot
from diagrams.offboard.virtual_flight import VirtualFlight
from diagrams.studies.columns import tabulate
from diagrams.studies.options import FlownOptions, FlownRun, Seeds
from np_drake.offboard.phases import Phase
from np_drake.vehicle.scaling import usual_rate_loop

BEGIN = (4.0, 6.0)  # of a fault, in the ramp of the circle [s]
AFTER = 4.0  # flown after it [s]
NEAR, GROUND = 5.0, 0.05  # within which of its start, and above which height, a vehicle is kept [m]
GAP = 0.3  # without a command: the node has stopped [s]
SLACK = 0.03  # of a stop: a message, its way, and a tick [s]


@dc.dataclass(frozen=True)
class Options(FlownOptions):
    """Options of the study."""

    seeds: Seeds = 11
    real_time: Annotated[
        float,
        Option(
            "--real-time", min=0.0, max=86_400.0, help="Time of a flight in real time; 0: none [s]."
        ),
    ] = 0.0


def flight(controller: str = "np") -> FlightConfig:
    """Return the circle of the paper's vehicle with its payload, for a node."""
    config = load_experiment("circle")
    vehicle = dc.replace(config.vehicle, rate_loop=usual_rate_loop(config.vehicle))
    config = dc.replace(config, vehicle=vehicle).with_autopilot("rate_loop")
    config.controller.kind, config.controller.solver = controller, "sqp"
    return config.check_and_step()


def stated_time(fault: Fault, config: FlightConfig) -> float | None:
    """Return the longest time from the beginning of a fault to the last command; None where it need
    not stop [s].
    """
    limits = config.offboard
    if fault.kind not in (*STATE_LOST, *SOLVER):
        return None
    noticed = (
        limits.stale_after
        if fault.kind in STATE_LOST
        else (limits.late_solves + 1) * config.controller.period
    )
    longest = noticed + limits.level + SLACK
    return longest if fault.lasts > longest else None


@dc.dataclass(frozen=True)
class Flying:
    """Work of a case: {"fault", "seed"} -> what became of it."""

    config: FlightConfig

    def __call__(self, case: Case) -> dict:
        """Fly the case."""
        fault = Fault.drawn(case["fault"], case["seed"], BEGIN)
        flown: list[VirtualFlight] = []
        flight = VirtualFlight(
            self.config,
            seed=case["seed"],
            passes=fault.passes(),
            autopilot=lambda vehicle: FaultyAutopilot(vehicle, fault),
            worker=lambda: fault.worker(lambda: flown[0].time if flown else 0.0),
        )
        flown.append(flight)
        begin, end = fault.begin, fault.begin + fault.lasts
        flight.advance(begin)
        handed_over = flight.autopilot.engaged
        events = list(flight.node.events) if flight.node else []
        if fault.kind == "node restart":
            flight.node = None
            flight.advance(end)
            flight.node = flight.new_node()
        kept = True
        for _ in range(round((fault.lasts + AFTER) / 0.1)):
            flight.advance(flight.time + 0.1)
            off = flight.position - self.config.motion.sample(np.zeros(1))[0, 0]
            kept = kept and bool(np.linalg.norm(off) < NEAR and flight.position[2] > GROUND)
        node = flight.node
        later = [event for event in (node.events if node else []) if event not in events]
        finite = all(np.isfinite([*one.rates, one.thrust]).all() for _, one in flight.sent)
        return {
            "fault": fault.kind,
            "seed": case["seed"],
            "size": fault.size,
            "lasts": fault.lasts,
            "handed_over": handed_over,
            "kept": kept,
            "finite": finite,
            "levelled": any(event.phase is Phase.LEVEL for event in later),
            "stopped": any(event.phase is Phase.STOPPED for event in later),
            "flies": bool(node is not None and node.phase is Phase.FLYING),
            "stop": _stop(flight, begin),
            "stated": stated_time(fault, self.config),
        }


def _stop(flight: VirtualFlight, begin: float) -> float | None:
    """Return the time from a fault's beginning to the last command before a gap; None where there
    is none [s].
    """
    times = np.array([t for t, _ in flight.sent if t >= begin - GAP] + [flight.time])
    gaps = np.flatnonzero(np.diff(times) > GAP)
    return float(max(times[gaps[0]] - begin, 0.0)) if len(gaps) else None


def run(run: Run, options: Options) -> Report:
    """Faults of link, state, solver and processes while a node flies: what it sends, and when it
    stops.
    """
    run = FlownRun.of(run, options)
    config = flight()
    cases = [{"fault": kind, "seed": seed} for kind in KINDS for seed in run.seeds]
    told = {**run.settings, "offboard": dc.asdict(config.offboard)}
    records = run.cases("node", "faults", Flying(config), cases, config=told)
    flown, failed = results(records), failures(run.workers.finished)
    lines = [_line(kind, [one for one in flown if one["fault"] == kind]) for kind in KINDS]
    title = f"{len(cases)} faults, seeds {run.seeds[0]} … {run.seeds[-1]}"
    columns = (
        ("fault", "fault"),
        ("flights", "flights"),
        ("levelled", "levelled"),
        ("stopped", "stopped"),
        ("slowest stop [s]", lambda line: _time(line["slowest"])),
        ("stated [s]", lambda line: _time(line["stated"])),
        ("flies on", "flies"),
        ("kept", "kept"),
    )
    beside = _beside(run, config, options.real_time) if options.real_time > 0 else None
    bound = [one for one in flown if one["stated"] is not None]
    late = sum(one["stop"] is None or one["stop"] > one["stated"] for one in bound)
    return Report(
        [tabulate(title, lines, columns), *([_real_time(beside)] if beside else [])],
        config=told,
        metrics={"table": lines, "exceptions": len(failed), "real_time": beside},
        notes=[
            f"exceptions: {len(failed)} of {len(cases)}",
            f"flights with a command that is not finite: {sum(not one['finite'] for one in flown)}",
            f"stops after their stated time: {late} of {len(bound)}",
            f"not handed over before the fault: {sum(not one['handed_over'] for one in flown)}",
            *failed,
        ],
    )


def _beside(run: Run, config: FlightConfig, seconds: float) -> dict[str, Any]:
    config = dc.replace(config, duration=seconds).check()
    with run.progress("flying in real time", config.end) as advance:
        return flown_beside(config, seed=run.seed, monitor=advance)


def _real_time(beside: dict[str, Any]) -> Table:
    found = beside["deadlines"]
    times = [
        (name, "{median:.2f}, {p95:.2f}, {max:.2f}".format(**found[key]))
        for name, key in (
            ("solve: median, p95, max [ms]", "solve_ms"),
            ("tick after its time: median, p95, max [ms]", "jitter_ms"),
            ("age of the state: median, p95, max [ms]", "state_age_ms"),
        )
    ]
    rows = [
        ("flown [s], at [Hz]", f"{beside['node']['flown']:.0f}, {beside['rate']:.1f}"),
        ("ticks, skipped", f"{found['ticks']}, {found['skipped']}"),
        ("solves, late", f"{found['periods']}, {found['late']}"),
        *times,
        ("E_xy of the node, of the Diagram [cm]", _both(beside, "E_xy")),
        ("E_z of the node, of the Diagram [cm]", _both(beside, "E_z")),
    ]
    return (
        "a node in real time, on a vehicle in another process, by UDP; errors as measured",
        ["of", "value"],
        rows,
    )


def _both(beside: dict[str, Any], name: str) -> str:
    return f"{100 * beside['node'][name]:.3f}, {100 * beside['diagram'][name]:.3f}"


def _line(kind: str, flown: list[dict]) -> dict[str, Any]:
    bound = [one for one in flown if one["stated"] is not None]
    stops = [one["stop"] for one in bound if one["stop"] is not None]
    counted = {
        name: sum(one[name] for one in flown) for name in ("levelled", "stopped", "flies", "kept")
    }
    times = {
        "slowest": max(stops, default=None),
        "stated": max((one["stated"] for one in bound), default=None),
    }
    return {"fault": kind, "what": KINDS[kind][0], "flights": len(flown), **counted, **times}


def _time(value: float | None) -> str:
    return "–" if value is None else f"{value:.2f}"
