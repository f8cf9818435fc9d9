"""Tether length identified from simulated flights, by experiment and length."""

from diagrams.batch.campaign import Case
from diagrams.batch.columns import tabulate
from diagrams.batch.run import NoOptions as Options
from diagrams.batch.run import Report, Run
from diagrams.batch.workers import failures, results
from diagrams.loop.experiments import load_experiment, settings_of
from diagrams.loop.flight_result import fly
from np_drake.skill.tether_length import Pendulum, pendulum_length
from np_drake.training_data.training_segments import training_segments

LENGTHS = (0.5, 0.8, 1.2)  # [m]
EXPERIMENTS = ("training_circle", "plain_circle")  # that are flown


def fly_and_read(
    experiment: str, *, length: float, seed: int, duration: float | None = None
) -> Pendulum:
    """Fly the experiment on a tether of `length` [m] with the nominal MPC and identify the length
    from its labels.

    Args:
        length: of the tether [m].
        duration: after the ramp; None: the experiment's [s].
    """
    config = load_experiment(experiment)
    config.controller.kind, config.controller.solver = "nominal", "sqp"
    config.reality.payload.length = length
    config.duration = config.duration if duration is None else duration
    flight = fly(config, seed=seed)
    log, start = flight.log(), int(flight.scored.argmax())
    segments = training_segments(
        log.rows(start, len(log)),
        config.vehicle,
        config.controller.label,
        step=config.controller.period,
    )
    return pendulum_length(segments, gravity=config.vehicle.gravity, seed=seed)


def _line_of(case: Case) -> dict:
    """Return the line of the case {"flight", "length", "seed"}."""
    found = fly_and_read(case["flight"], length=case["length"], seed=case["seed"])
    return {
        "flight": case["flight"],
        "length": case["length"],
        "found": found.length if found.shown else None,
        "frequency": found.mode.frequency if found.mode else None,
        "damping": found.mode.damping if found.mode else None,
        "motion": found.motion,
        "text": found.text,
    }


def run(run: Run, options: Options) -> Report:
    """The tether's length from the payload's mode. For circles with and without dither."""
    cases = [
        {"flight": experiment, "length": length, "seed": run.seed}
        for experiment in EXPERIMENTS
        for length in LENGTHS
    ]
    config = {name: settings_of(load_experiment(name)) for name in EXPERIMENTS}
    lines = results(run.cases("flights", "", _line_of, cases, config=config))
    columns = (
        ("flight", "flight"),
        ("tether [m]", "length"),
        ("found [m]", "found"),
        ("mode [Hz]", "frequency"),
        ("damping", "damping"),
        ("motion / noise", "motion"),
    )
    return Report(
        [tabulate(f"tether from the payload's mode, seed {run.seed}", lines, columns)],
        config={"experiments": EXPERIMENTS, "lengths": LENGTHS},
        metrics={"table": lines},
        lines=[f"{line['flight']}, {line['length']} m: {line['text']}" for line in lines],
        notes=failures(run.workers.finished),
    )
