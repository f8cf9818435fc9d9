"""Demo: fly, learn, fly again, diagnose what the model lacks, correct the simulator, compare it
with the flights.
"""

import dataclasses as dc
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from operator import call
from pathlib import Path
from typing import Any

from diagrams.batch.run import FailedRun, as_they_finish
from diagrams.evidence.studies.sweep import Row, configure, training_config
from diagrams.evidence.studies.tracking import PACKAGED, TRACKS
from diagrams.gap.corrected import corrected_simulator
from diagrams.gap.drake_replay import DrakeReplay
from diagrams.gap.side_by_side import SideBySide, side_by_side
from diagrams.loop.flight import FlightConfig
from diagrams.loop.flight_result import FlightResult, fly
from diagrams.loop.reality import RealityConfig
from diagrams.training import TRAINING, train_model
from np_drake.diagnosis.diagnose import diagnose
from np_drake.diagnosis.result import Diagnosis
from np_drake.effects.base import Effect
from np_drake.flight_log import FlightLog
from np_drake.payload_filter.model_file import PAYLOAD_FILTER
from np_drake.vehicle import Vehicle

NOMINAL = Row("nominal", "nominal")
HOLD = Row("hold", "hold")
LEARNED = Row("np", "np")
FILTER = Row(PAYLOAD_FILTER, PAYLOAD_FILTER)
ROWS = (NOMINAL, HOLD, LEARNED, FILTER)
HELD_OUT = TRACKS[-1]  # judges the diagnosis, and is flown in the simulators
DIAGNOSED = 20.0  # of every flight of the nominal MPC, after the ramp [s]
SIMULATED = 15.0  # in either simulator, after the ramp [s]
SIMULATORS = ("nominal", "corrected")
FORETOLD = (NOMINAL, LEARNED)  # controllers that fly in the simulators
LEARNING = 0.6  # share of the time that training and the first flights take [1]


@dc.dataclass(frozen=True)
class Demo:
    """Results of the demo.

    trained: what the model was trained on. flights: by track and kind of controller.
    diagnosis: of the flights of the nominal MPC.
    beside: the held-out flight and its replays.
    simulated: flights of the held-out track by simulator and kind of controller, of
        `simulated_seconds` after the ramp [s].
    """

    seed: int
    training: FlightResult
    trained: Mapping[str, Any]
    flights: Mapping[tuple[str, str], FlightResult]
    diagnosis: Diagnosis
    replays: SideBySide
    simulated: Mapping[tuple[str, str], FlightResult]
    simulated_seconds: float

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

    def reduction(self) -> dict[str, dict[str, float]]:
        """Return the relative reduction of the nominal MPC's error by NP-MPC, by track [1]."""
        cuts = {}
        for track in TRACKS:
            learned, nominal = (self.flights[track, r.kind].metrics() for r in (LEARNED, NOMINAL))
            cuts[track] = {key: 1.0 - learned[key] / nominal[key] for key in ("E_xy", "E_z")}
        return cuts

    def meeting(self) -> list[dict[str, Any]]:
        """Return errors on the held-out track, in flight and as either simulator foretells them, by
        controller [m].
        """
        lines = []
        for row in FORETOLD:
            flight = until(self.flights[HELD_OUT, row.kind], self.simulated_seconds).metrics()
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

    The nominal MPC flies the training circle (noise of `seed`), to which both predictors are
    fitted. Nominal MPC, hold, NP-MPC and the MPC with the payload filter fly both tracks (seed +
    1). The flights of the nominal MPC are diagnosed: training circle and circle to fit, the
    lemniscate to judge. Nominal and corrected simulator fly the lemniscate (seed + 2). Writes the
    models into `folder`.

    Args:
        simulated: length of the flights in either simulator, after the ramp, at most that of a
            flight [s].
        on_progress: is told the share that is done and what is done next.
    """
    models = {row.kind: folder / f"{row.kind}.safetensors" for row in (LEARNED, FILTER)}
    practice = training_config(TRAINING, solver=solver)
    vehicle = dc.replace(practice.vehicle, command_timing="held")  # as a simulator logs them
    configs = {
        (track, row.kind): configure(track, row, solver=solver, model=str(models.get(row.kind, "")))
        for track in TRACKS
        for row in ROWS
    }
    trips = {key: partial(fly, config, seed=seed + 1) for key, config in configs.items()}

    seconds = min(simulated, *(config.duration for config in configs.values()))

    def in_simulator(world: RealityConfig, kind: str) -> Callable[[], FlightResult]:
        config = dc.replace(configs[HELD_OUT, kind], reality=world, duration=seconds)
        return partial(fly, config.check_and_step(), seed=seed + 2)

    learned = {key: trip for key, trip in trips.items() if key[1] in models}
    unlearned = {key: trip for key, trip in trips.items() if key[1] not in models}

    done = _side_by_side(
        {"learned": partial(_learn, practice, seed, models), **unlearned},
        jobs,
        lambda share: on_progress(LEARNING * share, "training and flights"),
    )
    training, trained = done.pop("learned")
    foretold = {
        ("nominal", row.kind): in_simulator(practice.reality.nominal(), row.kind)
        for row in FORETOLD
    }
    look = partial(
        _diagnose,
        vehicle,
        [diagnosed(training), diagnosed(done[TRACKS[0], NOMINAL.kind])],
        [diagnosed(done[HELD_OUT, NOMINAL.kind])],
        in_simulator,
    )
    done |= _side_by_side(
        {"diagnosis": look, **learned, **foretold},
        jobs,
        lambda share: on_progress(LEARNING + (1 - LEARNING) * share, "diagnosis and flights"),
    )
    diagnosis, replays, corrected = done.pop("diagnosis")
    return Demo(
        seed=seed,
        training=training,
        trained=trained,
        flights={key: done[key] for key in configs},
        diagnosis=diagnosis,
        replays=replays,
        simulated={key: done[key] for key in foretold} | corrected,
        simulated_seconds=seconds,
    )


def _side_by_side(
    work: Mapping[Any, Callable[[], Any]], jobs: int, tell: Callable[[float], None]
) -> dict[Any, Any]:
    """Return the results by the keys of the work, done in several processes; 1: in this one.

    Raises: what the work raises; FailedRun: where its process died.
    """
    tell(0.0)
    keys = list(work)
    results = {}
    alone = enumerate(task() for task in work.values())
    for number, value in alone if jobs == 1 else as_they_finish(call, list(work.values()), jobs):
        if isinstance(value, FailedRun):
            raise value
        results[keys[number]] = value
        tell(len(results) / len(keys))
    return results


def _learn(
    config: FlightConfig, seed: int, models: Mapping[str, Path]
) -> tuple[FlightResult, dict[str, Any]]:
    """Return the training flight and what the models, which are written, were trained on."""
    flight = fly(config, seed=seed)
    train_model(flight, models[FILTER.kind], PAYLOAD_FILTER)
    return flight, train_model(flight, models[LEARNED.kind], PACKAGED, seed=seed)


def _diagnose(
    vehicle: Vehicle,
    train: Sequence[FlightLog],
    held_out: Sequence[FlightLog],
    in_simulator: Callable[[RealityConfig, str], Callable[[], FlightResult]],
) -> tuple[Diagnosis, SideBySide, dict[tuple[str, str], FlightResult]]:
    """Return the diagnosis, the held-out flight beside its simulators, and flights in the corrected
    one.
    """
    replay = DrakeReplay(vehicle)
    diagnosis = diagnose(train, held_out, vehicle, replay, adaptive_split=False)
    replays = side_by_side(diagnosis, vehicle, held_out, replay)
    world = corrected_simulator(diagnosis, vehicle).reality
    flown = {("corrected", row.kind): in_simulator(world, row.kind)() for row in FORETOLD}
    return diagnosis, replays, flown


def diagnosed(flight: FlightResult) -> FlightLog:
    """Return the part of the log of a flight that is diagnosed."""
    log = flight.log()
    start = flight.config.reference.lead
    first, last = log.t.searchsorted([start - 1e-9, start + DIAGNOSED - 1e-9])
    return dc.replace(log.rows(int(first), int(last)), name=f"{flight.config.name}.csv")


def until(flight: FlightResult, seconds: float) -> FlightResult:
    """Return the flight up to `seconds` after its ramp."""
    rows = flight.signals["t"] < flight.config.reference.lead + seconds - 1e-9
    signals = {name: signal[rows] for name, signal in flight.signals.items()}
    return dc.replace(flight, signals=signals)
