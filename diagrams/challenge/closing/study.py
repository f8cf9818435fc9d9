"""One vehicle: flown, diagnosed, and flown again with controllers from several simulators."""

import dataclasses as dc
import tempfile
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from diagrams.batch.campaign import Case
from diagrams.challenge.closing.reality import (
    DITHER,
    FLOWN_WITH,
    HELD_OUT,
    MOST,
    TRAINING,
    WITHHELD,
    diagnosed_flights,
    experiment,
    nominal_reality,
    withheld_reality,
)
from diagrams.gap.corrected import corrected_simulator, drawn
from diagrams.loop.flight import FlightConfig, LostVehicle
from diagrams.loop.flight_result import fly
from diagrams.loop.reality import RealityConfig
from np_drake.diagnosis.diagnose import diagnose
from np_drake.logs.flight_log import FlightLog
from np_drake.logs.training_segments import Flight
from np_drake.residual_models.pendulum_training import opened_logs, train_pendulum
from np_drake.vehicle import Vehicle

TRACK = "circle"  # that is scored
SCORED = 15.0  # of it, after the ramp [s]
LEARNED_ON = ("training_circle", 60.0)  # flight that is trained on in a simulator, and its length [s]
SAMPLES = 3  # simulators of the posterior, on whose flights together one predictor is trained [1]
NOMINAL, CORRECTED, SAMPLED, REAL = (
    "nominal simulator",
    "corrected simulator",
    "posterior samples",
    "real flights",
)
PLAIN = ("nominal", "hold", "observer", "oracle")  # controllers that are not trained
TRAINED_IN = (NOMINAL, CORRECTED, SAMPLED, REAL)  # where the predictor of `np` comes from
ROWS = (*PLAIN, *TRAINED_IN)


@dc.dataclass(frozen=True)
class Closing:
    """Work of a case {"seed"} -> errors of every row, on the real vehicle and as its own simulator foretold.

    solver: of the MPC.
    """

    solver: str

    def __call__(self, case: Case) -> dict:
        """Return {"withheld", "verdict", "E_xy": {row: [m]}, "foretold": {row: [m]}}; a lost vehicle has no number."""
        seed, vehicle = case["seed"], Vehicle()
        real = withheld_reality(seed, vehicle)
        train, held_out = diagnosed_flights(real, vehicle, solver=self.solver, seed=seed)
        found = diagnose(vehicle, train, held_out, adaptive_split=False)
        corrected = corrected_simulator(found, vehicle)
        samples = [c.reality for c in _drawn(corrected, seed)]
        with tempfile.TemporaryDirectory() as scratch:
            folder = Path(scratch)
            worlds: Mapping[str, Sequence[RealityConfig]] = {
                NOMINAL: [nominal_reality()],
                CORRECTED: [corrected.reality],
                SAMPLED: samples,
            }
            models = {
                row: self._learned(own, vehicle, seed, folder / f"{k}.safetensors")
                for k, (row, own) in enumerate(worlds.items())
            }
            models[REAL] = _trained(train, vehicle, folder / "real.safetensors")
            errors = {row: self._error(row, models.get(row), real, vehicle, seed) for row in ROWS}
            foretold = {
                row: self._error(row, models[row], worlds[row][0], vehicle, seed)
                for row in (NOMINAL, CORRECTED)
            }
        return {
            "withheld": [entry.effect for entry in real.effects],
            "verdict": list(found.verdict),
            "E_xy": errors,
            "foretold": foretold,
        }

    def _learned(self, worlds: Sequence[RealityConfig], vehicle: Vehicle, seed: int, path: Path) -> Path:
        """Fly the training flight in every world, and return the file of a predictor trained on all of them."""
        name, seconds = LEARNED_ON
        logs = []
        for k, world in enumerate(worlds):
            config = experiment(name, world, vehicle, solver=self.solver, seconds=seconds / len(worlds))
            config.controller.kind = "hold"
            logs.append(dc.replace(fly(config, seed=10 * seed + 5 + k).log(), name=f"{name}_{k}"))
        return _trained(logs, vehicle, path)

    def _error(
        self, row: str, model: Path | None, world: RealityConfig, vehicle: Vehicle, seed: int
    ) -> float | None:
        """Return E_xy of a row in a world [m]; None where the vehicle is lost or the oracle does not know the world."""
        config = experiment(TRACK, world, vehicle, solver=self.solver, seconds=SCORED)
        config.controller.kind = row if model is None else "np"
        config.controller.predictor = "" if model is None else str(model)
        try:
            return float(fly(config.check(), seed=1000 + seed).metrics()["E_xy"])
        except (LostVehicle, ValueError):
            return None


def _drawn(corrected: FlightConfig, seed: int) -> list[FlightConfig]:
    """Return the simulators of the posterior; the corrected one alone where nothing is uncertain."""
    certain = not corrected.reality.effects
    return [corrected] if certain else drawn(corrected, SAMPLES, seed)


def _trained(logs: Sequence[FlightLog], vehicle: Vehicle, path: Path) -> Path:
    flights = opened_logs([Flight(log, vehicle) for log in logs])
    train_pendulum(flights, step=0.02).save(path)
    return path


def settings(solver: str) -> dict[str, Any]:
    """Return all that the results depend on other than the seed."""
    return {
        "solver": solver, "withheld": WITHHELD, "most": MOST, "training": TRAINING, "held_out": HELD_OUT,
        "dither": DITHER, "flown_with": FLOWN_WITH, "track": TRACK, "scored": SCORED, "learned_on": LEARNED_ON,
        "samples": SAMPLES,
    }  # fmt: skip


def table(results: Sequence[dict]) -> list[dict]:
    """Return a line for every row: quartiles of E_xy over the vehicles that it flew [m], and how many it lost.

    The oracle does not fly a vehicle whose mass properties it does not know; that is not a loss.
    """
    lines = []
    for row in ROWS:
        values = [r["E_xy"][row] for r in results]
        flown = [value for value in values if value is not None]
        lower, median, upper = np.percentile(flown, [25, 50, 75]).tolist() if flown else (None, None, None)
        lost = 0 if row == "oracle" else len(values) - len(flown)
        line = {"row": row if row in PLAIN else f"np: {row}", "flown": len(flown), "lost": lost}
        lines.append({**line, "lower": lower, "median": median, "upper": upper})
    return lines


def gained(results: Sequence[dict]) -> dict[str, float]:
    """Return medians over the cases of what a diagnosis gains [1].

    fall: of E_xy from the predictor of the nominal simulator to that of the corrected one.   over_real: E_xy of the
    latter over that of a predictor trained on real flights.   foretold: |E_sim - E_real| / E_real in either simulator.
    """

    def median(ratio: Callable[[dict], float | None]) -> float:
        values = [value for r in results if (value := ratio(r)) is not None]
        return float(np.median(values)) if values else float("nan")

    def over(a: float | None, b: float | None) -> float | None:
        if b is None:
            return None
        return np.inf if a is None else a / b

    def off(r: dict, row: str) -> float | None:
        sim, real = r["foretold"][row], r["E_xy"][row]
        return None if real is None else (np.inf if sim is None else abs(sim - real) / real)

    return {
        "fall": 1.0 - median(lambda r: over(r["E_xy"][CORRECTED], r["E_xy"][NOMINAL])),
        "over_real": median(lambda r: over(r["E_xy"][CORRECTED], r["E_xy"][REAL])),
        f"foretold by the {NOMINAL}": median(lambda r: off(r, NOMINAL)),
        f"foretold by the {CORRECTED}": median(lambda r: off(r, CORRECTED)),
    }
