"""Result of a cooperative flight, and the flights over fleets and controllers."""

import dataclasses as dc
from collections.abc import Callable, Sequence
from functools import cached_property

import numpy as np

from diagrams.batch.arrays import packed, unpacked
from diagrams.batch.campaign import Case
from diagrams.batch.failed_run import FailedRun
from diagrams.batch.workers import Workers, require_result
from diagrams.cooperative.config import CooperativeConfig, load_cooperative
from diagrams.cooperative.diagram import center_of_formation, simulate
from diagrams.loop.experiments import settings_of
from np_drake import metrics
from np_drake.mpc.problem import MpcStatus
from np_drake.references.formation import closest_approach

ROWS = {  # name: kind of controller, fault of predictor 0
    "nominal": ("nominal", "none"),
    "hold": ("hold", "none"),
    "payload_filter": ("payload_filter", "none"),
    "payload_filter, one at zero": ("payload_filter", "zero"),
    "payload_filter, one frozen": ("payload_filter", "frozen"),
}
PHASES = ("hover", "transport")  # that are scored


@dc.dataclass
class CooperativeResult:
    """One simulated flight of a fleet.

    signals: in the form of `Recorder.read`, those of vehicle i with `_i`.
    """

    config: CooperativeConfig
    seed: int  # of the noise
    signals: dict[str, np.ndarray]
    processor_time: float  # [s]

    def each(self, name: str) -> np.ndarray:
        """Return one signal of every vehicle, (vehicles, rows, size)."""
        return np.stack([self.signals[f"{name}_{i}"] for i in range(self.config.vehicles)])

    @cached_property
    def p(self) -> np.ndarray:
        """True positions of the vehicles, (vehicles, rows, 3) [m]."""
        return self.each("x")[:, :, :3]

    @cached_property
    def payload(self) -> np.ndarray:
        """True position of the payload, (rows, 3) [m]."""
        start = 7 * self.config.vehicles + 4
        return self.signals["plant_state"][:, start : start + 3]

    @cached_property
    def payload_ref(self) -> np.ndarray:
        """Equilibrium of the payload below the exact, level formation, unstretched cables, (rows, 3) [m]."""
        center = center_of_formation(self.config).sample(self.signals["t"])[0]
        return center + [0.0, 0.0, self.config.drop]

    def rows(self, phase: str) -> np.ndarray:
        """Return which rows belong to `phase`, (rows,).

        Args: phase: hover, transport (with the rest after it) or all, settling excluded.
        """
        t, config = self.signals["t"] + 1e-9, self.config
        begin = config.start if phase == "transport" else config.settle
        end = config.start if phase == "hover" else config.end
        return (t >= begin) & (t < end)

    def errors(self, phase: str) -> dict[str, float]:
        """Return the errors of all vehicles together and of the payload [m].

        `failed_*`: of vehicle 0, whose predictor may fail.
        """
        rows = self.rows(phase)
        p, p_ref = self.p[:, rows], self.each("p_ref")[:, rows]
        bob, bob_ref = self.payload[rows], self.payload_ref[rows]
        vehicles = metrics.tracking_errors(p.reshape(-1, 3), p_ref.reshape(-1, 3))
        return {
            **vehicles,
            "excursion": float(np.linalg.norm(p - p_ref, axis=-1).max()),
            "first_rmse": metrics.tracking_errors(p[0], p_ref[0])["position_rmse"],
            "payload_rmse": metrics.tracking_errors(bob, bob_ref)["position_rmse"],
            "payload_excursion": float(np.linalg.norm(bob - bob_ref, axis=-1).max()),
        }

    def metrics(self) -> dict:
        """Return the metrics as `--json` writes them; counts and times are over everything that is scored."""
        rows = self.rows("all")
        status, solve = self.each("status")[:, rows], self.each("solve_time")[:, rows]
        tension = np.linalg.norm(self.each("tether_wrench")[:, rows, :3], axis=-1)
        return {
            **{phase: self.errors(phase) for phase in PHASES},
            "solve_failures": int(np.sum(status >= MpcStatus.SQP_FALLBACK)),
            "fallbacks": int(np.sum(status >= MpcStatus.SHIFTED_PLAN)),
            "solve_ms": metrics.solve_times_ms(solve.ravel()),
            "processor_time": self.processor_time / self.config.end,
            "closest": closest_approach(self.p),
            "tension": {"mean": tension.mean(axis=1).tolist(), "min": tension.min(), "max": tension.max()},
        }


def fly_cooperative(config: CooperativeConfig, *, seed: int, monitor=None) -> CooperativeResult:
    """Simulate the experiment and return its result, see `simulate`."""
    return CooperativeResult(config, seed, *simulate(config, seed=seed, monitor=monitor))


def configure(row: str, vehicles: int, *, solver: str) -> CooperativeConfig:
    """Return the scenario with the controllers of `row` of the table and so many vehicles."""
    config = load_cooperative()
    config.vehicles, config.controller.solver = vehicles, solver
    config.controller.kind, config.fault = ROWS[row]
    return config.check()


@dc.dataclass(frozen=True)
class Flying:
    """Work of a flight {"vehicles", "row", "seed", "signals"} -> its metrics, or why the fleet was lost.

    signals: whether the result brings them along, as .npz in base 64.
    """

    solver: str

    def __call__(self, case: Case) -> dict:
        """Fly the case. A lost fleet is a result: another try would lose it too."""
        config = configure(case["row"], case["vehicles"], solver=self.solver)
        try:
            flight = fly_cooperative(config, seed=case["seed"])
        except FailedRun as error:
            return {"lost": str(error)}
        result: dict = {"metrics": flight.metrics()}
        if case["signals"]:
            result["signals"] = packed(flight.signals)
            result["processor_time"] = flight.processor_time
        return result

    def flight(self, case: Case, result: dict) -> CooperativeResult:
        """Return the flight whose signals a result brings along."""
        config = configure(case["row"], case["vehicles"], solver=self.solver)
        return CooperativeResult(config, case["seed"], unpacked(result["signals"]), result["processor_time"])


def run_cooperative(
    fleets: Sequence[int],
    *,
    seeds: Sequence[int],
    solver: str,
    rows: Sequence[str] = tuple(ROWS),
    workers: Workers | None = None,
    on_progress: Callable[[int, int], None] = lambda done, total: None,
) -> tuple[list[dict], list[CooperativeResult]]:
    """Fly every row with every number of vehicles, one flight a seed; return summaries and the first seed's flights.

    A lost fleet keeps its line, with the reason under `lost`; so does a case without a result.
    Raises: ValueError: before any flight; FailedRun: if no case has a result.
    """
    cases = [
        {"vehicles": n, "row": row, "seed": seed, "signals": seed == seeds[0]}
        for n in fleets
        for row in rows
        for seed in seeds
    ]
    settings = [settings_of(configure(row, n, solver=solver)) for n in fleets for row in rows]  # checks all
    work = Flying(solver)
    records = (workers or Workers()).run(
        work, cases, config={"solver": solver, "scenario": scenario(settings[0])}, on_progress=on_progress
    )
    require_result(records)
    summaries, flights = [], []
    for case, record in zip(cases, records, strict=True):
        result = record.get("result") or {"lost": record["error"]}
        kept = {"lost": result["lost"]} if "lost" in result else {"metrics": read_metrics(result["metrics"])}
        summaries.append({name: case[name] for name in ("vehicles", "row", "seed")} | kept)
        if "signals" in result:
            flights.append(work.flight(case, result))
    return summaries, flights


def read_metrics(stored: dict) -> dict:
    """Return metrics as flown from a record: a lone vehicle is infinitely far from the next."""
    return stored | {"closest": np.inf if stored["closest"] is None else stored["closest"]}


def scenario(settings: dict) -> dict:
    """Return the settings of a flight without those that a case names."""
    controller = {name: value for name, value in settings["controller"].items() if name != "kind"}
    return settings | {"controller": controller, "vehicles": None, "fault": None}
