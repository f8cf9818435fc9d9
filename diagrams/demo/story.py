"""Steps of the demo: flights, training, diagnosis of these flights, and flights in the corrected
simulator.
"""

import dataclasses as dc
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from diagrams.batch.failed_run import FailedRun
from diagrams.batch.processes import as_they_finish
from diagrams.gap.corrected import corrected_simulator
from diagrams.gap.drake_replay import DrakeReplay
from diagrams.gap.side_by_side import SideBySide, side_by_side
from diagrams.loop.flight import FlightConfig
from diagrams.loop.flight_result import FlightResult, fly
from diagrams.loop.reality import RealityConfig
from diagrams.studies.learning import train_payload_filter_model, train_predictor
from diagrams.studies.sweep import Row, configure, training_config
from diagrams.studies.tracking import TRACKS
from np_drake.diagnosis.diagnose import diagnose
from np_drake.diagnosis.result import Diagnosis
from np_drake.effects.base import Effect
from np_drake.flight_log import FlightLog
from np_drake.payload_filter.model_file import PAYLOAD_FILTER
from np_drake.vehicle import Vehicle

NOMINAL, HOLD, LEARNED = Row("nominal", "nominal"), Row("hold", "hold"), Row("np", "np")
FILTER = Row(PAYLOAD_FILTER, PAYLOAD_FILTER)
ROWS = (NOMINAL, HOLD, LEARNED, FILTER)
TRAINED = (LEARNED.kind, FILTER.kind)
TRAINING = "training_circle"
HELD_OUT = TRACKS[-1]  # judges the diagnosis, and is flown in the simulators
DIAGNOSED = 20.0  # of every flight of the nominal MPC, after the ramp [s]
SIMULATED = 15.0  # in either simulator, after the ramp [s]
SIMULATORS = ("nominal", "corrected")
FORETOLD = (NOMINAL, LEARNED)  # controllers that fly in the simulators
_SHARES = (0.6, 0.4)  # of the time, by round


@dc.dataclass(frozen=True)
class Demo:
    """Results of the demo.

    training: the training flight.
    trained: what the model was trained on.
    model: file of the Neural Predictor. flights: by track and controller.
    diagnosis: of the flights of the nominal MPC.
    beside: the held-out flight and its replays.
    simulated: flights of the held-out track by (simulator, kind of controller).
    """

    seed: int
    training: FlightResult
    trained: Mapping[str, Any]
    model: Path
    flights: Sequence[FlightResult]
    diagnosis: Diagnosis
    beside: SideBySide
    simulated: Mapping[tuple[str, str], FlightResult]

    @property
    def withheld(self) -> dict[str, dict[str, float]]:
        """Parameters of the effects that act on the vehicle, by identifier."""
        acting = self.training.config.reality.everything()
        return {e.identifier: e.values for e in acting if isinstance(e, Effect)}

    @property
    def seeds(self) -> str:
        """Seeds of the noise, and what each is of."""
        return (
            f"seed {self.seed} of the training, {self.seed + 1} of the flights, "
            f"{self.seed + 2} of the simulators"
        )

    @property
    def simulated_seconds(self) -> float:
        """Length of the flights in simulators, after the ramp [s]."""
        return next(iter(self.simulated.values())).config.duration

    def flown(self, track: str, kind: str) -> FlightResult:
        """Return the flight of a controller on a track."""
        return next(
            f for f in self.flights if f.config.name == track and f.config.controller.kind == kind
        )

    def reduction(self) -> dict[str, dict[str, float]]:
        """Return the relative reduction of the nominal MPC's error by NP-MPC, by track [1]."""
        cuts = {}
        for track in TRACKS:
            learned, nominal = (self.flown(track, row.kind).metrics() for row in (LEARNED, NOMINAL))
            cuts[track] = {key: 1.0 - learned[key] / nominal[key] for key in ("E_xy", "E_z")}
        return cuts

    def meeting(self) -> list[dict[str, Any]]:
        """Return errors on the held-out track, in flight and as either simulator foretells them, by
        controller [m].
        """
        lines = []
        for row in FORETOLD:
            flight = until(self.flown(HELD_OUT, row.kind), self.simulated_seconds).metrics()
            foretold = {name: self.simulated[name, row.kind].metrics() for name in SIMULATORS}
            for key in ("E_xy", "E_z"):
                line = {"controller": row.kind, "error": key, "flight": flight[key]}
                lines.append(line | {name: foretold[name][key] for name in SIMULATORS})
        return lines


def run_demo(
    folder: Path,
    *,
    seed: int,
    solver: str = "sqp",
    jobs: int = 2,
    simulated: float = SIMULATED,
    on_progress: Callable[[float, str], None] = lambda fraction, text: None,
) -> Demo:
    """Run all steps; those that do not depend on each other run side by side.

    The nominal MPC flies the training circle (noise of `seed`), on which both predictors are
    trained. Nominal MPC, hold, NP-MPC and the MPC with the payload filter fly both tracks (seed +
    1). The flights of the nominal MPC are diagnosed: training circle and circle to fit, the
    lemniscate to judge. Nominal and corrected simulator fly the lemniscate (seed + 2). Writes the
    models into `folder`.

    Args:
        simulated: length of the flights in either simulator, after the ramp, at most that of a
            flight [s].
        on_progress: is told the share that is done and what is done next.
    """
    models = {
        LEARNED.kind: folder / "predictor.safetensors",
        FILTER.kind: folder / "payload_filter.safetensors",
    }
    practice = training_config(TRAINING, solver=solver)
    vehicle = dc.replace(practice.vehicle, command_timing="held")  # as a simulator logs them
    nominal = practice.reality.nominal()
    tracked = {
        (track, row.kind): Trip(
            configure(track, row, solver=solver, model=str(models.get(row.kind, ""))), seed + 1
        )
        for track in TRACKS
        for row in ROWS
    }

    def in_simulator(world: RealityConfig, kind: str) -> Trip:
        return Trip(_within(world, tracked[HELD_OUT, kind].config, simulated), seed + 2)

    steps = _Steps(jobs, on_progress)
    unlearned = {key: trip for key, trip in tracked.items() if key[1] not in TRAINED}
    done = steps.run(
        "training and flights", {"learned": partial(_learn, practice, seed, models), **unlearned}
    )
    training, trained = done.pop("learned")
    train = [diagnosed(training), diagnosed(done[TRACKS[0], NOMINAL.kind])]
    held_out = [diagnosed(done[HELD_OUT, NOMINAL.kind])]
    learned = {key: trip for key, trip in tracked.items() if key not in unlearned}
    look = partial(_diagnose, vehicle, train, held_out, in_simulator)
    uncorrected = {("nominal", row.kind): in_simulator(nominal, row.kind) for row in FORETOLD}
    done |= steps.run("diagnosis and flights", {"diagnosis": look, **learned, **uncorrected})
    diagnosis, beside, corrected = done.pop("diagnosis")
    flights = [done[key] for key in tracked]
    foretold = {key: done[key] for key in uncorrected} | corrected
    return Demo(seed, training, trained, models[LEARNED.kind], flights, diagnosis, beside, foretold)


@dc.dataclass(frozen=True)
class Trip:
    """Flight to be made."""

    config: FlightConfig
    seed: int

    def __call__(self) -> FlightResult:
        """Return the flight."""
        return fly(self.config, seed=self.seed)


class _Steps:
    """Rounds of work in several processes, behind one progress."""

    def __init__(self, jobs: int, on_progress: Callable[[float, str], None]):
        self._jobs, self._on_progress, self._before = jobs, on_progress, 0.0
        self._shares = iter(_SHARES)

    def run(self, text: str, work: Mapping[Any, Callable[[], Any]]) -> dict[Any, Any]:
        """Return the results of one round by the keys of its work.

        Raises: what the work raises; FailedRun: where its process died.
        """
        share, keys = next(self._shares), list(work)
        self._on_progress(self._before, text)
        results = {}
        one_by_one = enumerate(task() for task in work.values())  # in this process
        beside = as_they_finish(_call, list(work.values()), self._jobs)
        for number, value in one_by_one if self._jobs == 1 else beside:
            if isinstance(value, FailedRun):
                raise value
            results[keys[number]] = value
            self._on_progress(self._before + share * len(results) / len(keys), text)
        self._before += share
        return results


def _call(work: Callable[[], Any]) -> Any:
    return work()


def _learn(
    config: FlightConfig, seed: int, models: Mapping[str, Path]
) -> tuple[FlightResult, dict[str, Any]]:
    """Return the training flight and what the models, which are written, were trained on."""
    flight = fly(config, seed=seed)
    train_payload_filter_model(flight, models[FILTER.kind])
    return flight, train_predictor(flight, models[LEARNED.kind], seed=seed).model.summary


def _diagnose(
    vehicle: Vehicle,
    train: Sequence[FlightLog],
    held_out: Sequence[FlightLog],
    in_simulator: Callable[[RealityConfig, str], Trip],
) -> tuple[Diagnosis, SideBySide, dict[tuple[str, str], FlightResult]]:
    """Return the diagnosis, the held-out flight beside its simulators, and flights in the corrected
    one.
    """
    replay = DrakeReplay(vehicle)
    found = diagnose(vehicle, train, held_out, replay, adaptive_split=False)
    beside = side_by_side(found, vehicle, held_out, replay)
    world = corrected_simulator(found, vehicle).reality
    return (
        found,
        beside,
        {("corrected", row.kind): in_simulator(world, row.kind)() for row in FORETOLD},
    )


def diagnosed(flight: FlightResult) -> FlightLog:
    """Return the part of the log of a flight that is diagnosed."""
    log, start = flight.log(), flight.config.reference.lead
    first, last = np.searchsorted(log.t, [start - 1e-9, start + DIAGNOSED - 1e-9])
    return dc.replace(log.rows(int(first), int(last)), name=f"{flight.config.name}.csv")


def until(flight: FlightResult, seconds: float) -> FlightResult:
    """Return the flight up to some time after its ramp.

    Args:
        seconds: after the ramp [s].
    """
    rows = flight.signals["t"] < flight.config.reference.lead + seconds - 1e-9
    return dc.replace(
        flight, signals={name: signal[rows] for name, signal in flight.signals.items()}
    )


def _within(world: RealityConfig, config: FlightConfig, longest: float) -> FlightConfig:
    """Return a flight in another simulator, of that length after the ramp at most [s]."""
    duration = min(longest, config.duration)
    return dc.replace(config, reality=world, duration=duration).check_and_step()
