"""Training on simulated flights, up to the model file.

On one flight; or, the priors of a filter bank, by flying over the envelope of a vehicle. Labels are
made from what a vehicle measures, as those of a real flight.
"""

import dataclasses as dc
import math
import tempfile
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from diagrams.batch.run import FailedRun, Run, as_they_finish, require
from diagrams.loop.controller_config import FILTER_MODEL, NP_MODEL
from diagrams.loop.experiments import load_experiment
from diagrams.loop.flight_result import FlightResult, fly
from diagrams.random_flights import Envelope, drawn_flight
from np_drake.flight_log import FlightLog
from np_drake.lifting.model.lifted_model import load_model
from np_drake.lifting.model.lpv_model import NEURAL_LPV, LpvModel
from np_drake.lifting.training.train import make_config
from np_drake.metrics import tracking_errors
from np_drake.payload_filter.bank_options import CONDITIONAL, BankOptions, Prior
from np_drake.payload_filter.model_file import PAYLOAD_FILTER, PayloadFilterModel
from np_drake.payload_filter.training import train_payload_filter
from np_drake.residual_models.motion_model import REACTIONS
from np_drake.residual_models.predictor_training import (
    fitted_lpv,
    train_motion_model,
    train_on_flights,
)
from np_drake.training_data.segments import Flight
from np_drake.vehicle import Vehicle
from np_drake.vehicle.scaling import ratios

TRAINING = "training_circle"  # experiment that shows the vehicle itself
SETTLED = 3.0  # after the ramp, before errors count, of the paper's vehicle [s]
# RMS distance beyond which the vehicle is at its limits, whatever is foreseen; of the paper's
# vehicle, own choice [m]
FAR = 0.03
OTHERS = ("log_length", "change", "damping")  # that are learned, beside those of each condition
FACTOR = 2.5  # by which a parameter is tried larger and smaller; own choice [1]
TEACHERS = {PAYLOAD_FILTER: 0.7, "hold": 0.3}  # controllers of the first round, shares; own choice
TAUGHT = 14.0  # how long a flight of a round lasts after the ramp, of the paper's vehicle [s]
TEACHING = 7  # stream of the draw of controllers
SOFT = "paper_vehicle"  # scenario whose weights of the MPC fly half of the second round
GAIN = 0.002  # share of the error that a change must take away; own choice: less is chance [1]


def train_model(
    flight: FlightResult, path: Path, configuration: str, *, seed: int = 0
) -> dict[str, Any]:
    """Train on the flight's log after the ramp, write the model file, and return its summary.

    `payload_filter` takes the bank of the packaged model, `neural-lpv` its network.
    Raises: ValueError: on an unknown configuration.
    """
    controller = flight.config.controller
    vehicle = flight.config.vehicle
    log = scored_log(flight)
    step = controller.period
    label = controller.label
    flights = [Flight(log, vehicle)]
    model: Any
    if configuration in REACTIONS:
        model, _ = train_motion_model(configuration, flights, step=step, label=label, seed=seed)
    elif configuration == PAYLOAD_FILTER:
        prior = PayloadFilterModel.load(FILTER_MODEL)
        model = train_payload_filter([(log, vehicle)], step=step, prior=prior)
    elif configuration == NEURAL_LPV:
        model = fitted_lpv(load_model(NP_MODEL), flights, step)
    else:
        config = make_config(configuration, seed=seed)
        model = train_on_flights(flights, config, step=step, label=label).model
    model.save(path)
    return model.summary


def scored_log(flight: FlightResult) -> FlightLog:
    """Return the flight's log after the ramp."""
    log = flight.log()
    return log.rows(int(flight.scored.argmax()), len(log))


def drawn_log(number: int, *, seed: int, vehicle: Vehicle, network: str) -> FlightLog | None:
    """Return the log of a drawn flight; None where it cannot fly what was drawn, or is lost.

    Args:
        network: model file with which `np` flies it, often with soft weights; empty: a common
            controller does.
    """
    rng = np.random.default_rng([seed, number, TEACHING])
    try:
        _, config = drawn_flight(number, Envelope(), seed=seed, vehicle=vehicle)
        controller = config.controller
        if network:
            controller.kind = "np"
            controller.predictor = network
            if rng.random() < 0.5:
                controller.mpc = load_experiment(SOFT, vehicle).controller.mpc
        else:
            kind = str(rng.choice(list(TEACHERS), p=list(TEACHERS.values())))
            # The packaged filter is of the paper's vehicle
            controller.kind = kind if vehicle.mass == Vehicle().mass else "hold"
        config.duration = TAUGHT * ratios(vehicle).time
        return fly(config.check(), seed=number).log()
    except (ValueError, FailedRun):
        return None


def train_network_on_envelope(
    count: int, *, run: Run, vehicle: Vehicle, epochs: int | None
) -> tuple[LpvModel, list[float]]:
    """Return the network of a simulated vehicle, and its loss now and then.

    A first network learns from the training circle and `count` drawn flights of common controllers,
    the second one from these and as many that the first has flown,
    in twice as many steps.
    """
    circle = fly(load_experiment(TRAINING, vehicle), seed=run.seed)
    step = circle.config.controller.period
    flights = [Flight(scored_log(circle), vehicle)]
    config: Any = make_config(NEURAL_LPV, seed=run.seed, epochs=epochs)
    with tempfile.TemporaryDirectory() as folder:
        first = Path(folder) / "first.safetensors"
        rounds = ((0, "", config.epochs // 2), (count, str(first), config.epochs))
        for begin, network, steps in rounds:
            work = partial(drawn_log, seed=run.seed, vehicle=vehicle, network=network)
            logs = dict[int, FlightLog]()
            with run.bar("flying the envelope", count) as advance:
                drawn = as_they_finish(work, range(begin, begin + count), run.workers.jobs)
                for done, (number, log) in enumerate(drawn, 1):
                    if isinstance(log, FlightLog):
                        logs[number] = log
                    advance(done, f"{len(logs)} flown")
            require(logs, "--envelope: this vehicle flew none of what was drawn; draw more.")
            flights += [Flight(logs[number], vehicle) for number in sorted(logs)]
            with run.bar("training the network", 1.0) as advance:
                result = train_on_flights(
                    flights,
                    dc.replace(config, epochs=steps),
                    step=step,
                    on_epoch=lambda done, total, loss: advance(done / total, f"loss {loss:.4g}"),
                )
            result.model.save(first)
    model: Any = result.model
    summary = {**model.summary, "learned": {"flights": len(flights), "seed": run.seed}}
    return dc.replace(model, summary=summary), result.loss


def flown_error(
    number: int, *, model: PayloadFilterModel, seed: int, vehicle: Vehicle
) -> float | None:
    """Return the logarithm of the RMS distance from the track [m] of a drawn flight with a model,
    at most that of `FAR`, which is also that of a lost vehicle; None where it cannot fly what was
    drawn.
    """
    far = FAR * ratios(vehicle).length
    try:
        _, config = drawn_flight(number, Envelope(), seed=seed, vehicle=vehicle)
    except ValueError:
        return None
    config.controller.kind = PAYLOAD_FILTER
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "model.safetensors"
        model.save(path)
        config.controller.predictor = str(path)
        try:
            s = fly(config.check(), seed=number).signals
        except FailedRun:
            return math.log(far)
    steady = s["t"] >= config.reference.lead + SETTLED * ratios(vehicle).time
    errors = tracking_errors(s["x_true"][steady, :3], s["p_ref"][steady])
    return math.log(min(errors["position_rmse"], far))


def train_on_envelope(
    count: int, *, run: Run, vehicle: Vehicle
) -> tuple[PayloadFilterModel, list[float]]:
    """Return the model of a simulated vehicle, and the geometric mean of the flights' errors after
    each trial [m]: the vehicle from its training circle, the priors from `count` drawn flights.
    """
    circle = fly(load_experiment(TRAINING, vehicle), seed=run.seed)
    step = circle.config.controller.period
    model = train_payload_filter([(scored_log(circle), vehicle)], step=step)

    def error(bank: BankOptions) -> float:
        tried = dc.replace(model, bank=bank)
        work = partial(flown_error, model=tried, seed=run.seed, vehicle=vehicle)
        flown = (log for _, log in as_they_finish(work, range(count), run.workers.jobs))
        logs = [log for log in flown if log is not None]
        require(logs, "--envelope: this vehicle can fly none of what was drawn; draw more flights.")
        return math.exp(math.fsum(logs) / len(logs))

    with run.bar("learning priors", 1.0) as advance:
        bank, course = learn_priors(
            BankOptions(),
            error,
            lambda done, total, least: advance(done / total, f"{100 * least:.3f} cm"),
        )
    return dc.replace(model, bank=bank, learned={"flights": count, "seed": run.seed}), course


def learn_priors(
    first: BankOptions,
    error: Callable[[BankOptions], float],
    on_trial: Callable[[int, int, float], None],
) -> tuple[BankOptions, list[float]]:
    """Return the priors that a search finds from `first`, one parameter after the other, and the
    error after each trial.

    Source: pattern search, Hooke, Jeeves 1961, a single sweep.

    Args:
        error: of priors, positive.
        on_trial: called with parameters done, all of them, and the least error so far.
    """
    best = first
    least = error(first)
    course = [least]
    names = [(name, entry) for name in CONDITIONAL for entry in range(first.conditions)]
    names += [(name, -1) for name in OTHERS]
    for done, (name, entry) in enumerate(names, start=1):
        for factor in (FACTOR, 1 / FACTOR):
            tried = _changed(best, name, entry, factor)
            trial = error(tried)
            if trial < (1 - GAIN) * least:
                best = tried
                least = trial
                course.append(least)
                break
            course.append(least)
        on_trial(done, len(names), least)
    return best, course


def _changed(options: BankOptions, name: str, entry: int, factor: float) -> BankOptions:
    """Return the options with a number, a deviation or an entry of a tuple times `factor`."""
    value: Any = getattr(options, name)
    if isinstance(value, Prior):
        value = dc.replace(value, deviation=factor * value.deviation)
    elif isinstance(value, tuple):
        value = tuple(v * factor if i == entry else v for i, v in enumerate(value))
    else:
        value = value * factor
    return dc.replace(options, **{name: value})
