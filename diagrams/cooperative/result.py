"""Result of a cooperative flight, and the flights over fleets and controllers."""

import dataclasses as dc
from collections.abc import Callable, Sequence
from functools import cached_property

import numpy as np

from diagrams.batch.failed_run import FailedRun
from diagrams.cooperative.config import CooperativeConfig, load_cooperative
from diagrams.cooperative.diagram import center_of_formation, simulate
from np_drake import metrics
from np_drake.mpc.problem import MpcStatus
from np_drake.references.formation import closest_approach

ROWS = {  # name: kind of controller, fault of predictor 0
    "nominal": ("nominal", "none"),
    "hold": ("hold", "none"),
    "np": ("np", "none"),
    "np, one at zero": ("np", "zero"),
    "np, one frozen": ("np", "frozen"),
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


def run_cooperative(
    fleets: Sequence[int],
    *,
    seeds: Sequence[int],
    solver: str,
    rows: Sequence[str] = tuple(ROWS),
    on_progress: Callable[[float, float], None] = lambda done, total: None,
) -> tuple[list[dict], list[CooperativeResult]]:
    """Fly every row with every number of vehicles, one flight a seed; return summaries and the first seed's flights.

    A failed flight keeps its line, with the reason under `lost`.   Raises: ValueError: before any flight.
    """
    plans = [
        (n, row, seed, configure(row, n, solver=solver)) for n in fleets for row in rows for seed in seeds
    ]
    total, done = sum(config.end for *_, config in plans), 0.0
    summaries, flights = [], []
    for n, row, seed, config in plans:
        line: dict = {"vehicles": n, "row": row, "seed": seed}

        def advance(t: float, done: float = done) -> None:
            on_progress(done + t, total)

        try:
            flight = fly_cooperative(config, seed=seed, monitor=advance)
            line["metrics"] = flight.metrics()
            if seed == seeds[0]:
                flights.append(flight)
        except FailedRun as error:
            line["lost"] = str(error)
        summaries.append(line)
        done += config.end
    return summaries, flights
