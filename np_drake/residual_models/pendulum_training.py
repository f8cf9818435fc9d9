"""Training of a pendulum predictor: thrust error, drag, hook and rotor lag of the vehicle, from its own filter."""

import dataclasses as dc
from collections.abc import Callable, Sequence

import numpy as np

from np_drake import attitude
from np_drake.labels import labels
from np_drake.lifting.model.origin import origin_of
from np_drake.logs.accelerations import with_accelerations
from np_drake.logs.decimate import rows_at
from np_drake.logs.flight_log import FlightLog
from np_drake.logs.training_segments import require_torque
from np_drake.residual_models import pendulum_kernel as kernel
from np_drake.residual_models.base import Memory, Sample
from np_drake.residual_models.pendulum_model import PendulumModel
from np_drake.residual_models.pendulum_predictor import DEFAULT_BANK, RAW, PendulumPredictor
from np_drake.rigid_body import Q, W
from np_drake.rotor_lag import learned_rotor_lag
from np_drake.scaling import ratios, scales
from np_drake.vehicle import Vehicle

LASTING = 1e6  # memory while training: nothing returns to its prior [s]
# Of the paper's vehicle, in whose units of length and time they hold for any.
SETTLED = 5.0  # after which the pull serves to find the hook [s]; source: own choice, two swings
HOOK = 0.1  # prior deviation of the hook from Bo [m]; stated prior
THRUST_CHANGE, DRAG_CHANGE = 0.01, 0.02  # least deviations: from flight to flight [1, 1/s]; stated priors
Flights = Sequence[tuple[FlightLog, Vehicle]]


def train_pendulum(
    flights: Flights, *, step: float, on_pass: Callable[[int, int], None] = lambda *_: None
) -> PendulumModel:
    """Return the model of the vehicle that flew `flights`.

    The filter runs over them with wide priors, twice: the second time it knows the hook.
    Args: flights: logs that tell the rotors' torque.   step: between samples [s].   on_pass: called with (done, total).
    Raises: ValueError: if the logs are of different vehicles, or without torque or rows.
    """
    logs = [(with_accelerations(require_torque(log)), vehicle) for log, vehicle in flights]
    vehicle = logs[0][1]
    if any(other != vehicle for _, other in logs):
        raise ValueError("pendulum: all flights must be of one vehicle; give them one --vehicle FILE.")
    lag = learned_rotor_lag(logs)
    samples = [flight_samples(log, vehicle, lag, step) for log, _ in logs]
    hook = np.zeros(3)
    for done in (1, 2):
        model = _refined(_untrained(vehicle, lag, step, hook), samples)
        hook = model.hook
        on_pass(done, 2)
    summary = {
        "origin": origin_of("world", vehicle, RAW),
        "samples": sum(map(len, samples)),
    }
    return dc.replace(model, summary=summary)


def flight_samples(log: FlightLog, vehicle: Vehicle, rotor_lag: float, step: float) -> list[Sample]:
    """Return what a predictor would see of a flight, a sample every `step` [s].

    The label of a row is that of the command that acts at the row, its `u` the mean command since the row before.
    """
    lagged = dc.replace(vehicle, rotor_time_constant=vehicle.rotor_time_constant or rotor_lag)
    chi, rows = labels(log, lagged, RAW), rows_at(log, step)
    before = np.concatenate([[max(rows[0] - 1, 0)], rows[:-1]])
    return [
        Sample(log.x[row], log.u[start : max(row, start + 1)].mean(axis=0), chi[row])
        for start, row in zip(before, rows, strict=True)
    ]


def _untrained(vehicle: Vehicle, rotor_lag: float, step: float, hook: np.ndarray) -> PendulumModel:
    """Return the model before any flight, with the wide priors of the bank."""
    bank = DEFAULT_BANK.scaled(ratios(vehicle))
    thrust, drag = bank.thrust_error, bank.drag
    return PendulumModel(
        step,
        vehicle.mass,
        vehicle.gravity,
        rotor_lag,
        thrust.mean,
        thrust.deviation,
        drag.mean,
        drag.deviation,
        hook,
        arm=scales(vehicle).length,
    )


def _refined(model: PendulumModel, flights: Sequence[list[Sample]]) -> PendulumModel:
    """Return the model after its filter ran over the samples of all flights, one after the other."""
    gram, right = np.zeros((12, 12)), np.zeros(12)
    for samples in flights:
        predictor = PendulumPredictor(model, dc.replace(DEFAULT_BANK, memory=LASTING))
        memory = predictor.initial_memory()
        for k, sample in enumerate(samples):
            memory = predictor.update(memory, sample)
            if k * model.step >= SETTLED * model.unit.time:
                X = _torque_columns(predictor.pull(memory), samples[k - 1], sample, model.step)
                if np.all(np.isfinite(X)) and np.all(np.isfinite(sample.chi)):
                    gram, right = gram + X.T @ X, right + X.T @ sample.chi[3:]
        thrust, thrust_deviation = _posterior(memory, kernel.THRUST_ERROR)
        drag, drag_deviation = _posterior(memory, kernel.DRAG)
        model = dc.replace(
            model,
            thrust_error=thrust,
            thrust_error_deviation=max(thrust_deviation, THRUST_CHANGE),
            drag=drag,
            drag_deviation=max(drag_deviation, DRAG_CHANGE / model.unit.time),
        )
    hook, rate_torque = _torque(gram, right, flights, HOOK * model.unit.length)
    return dc.replace(model, hook=hook, rate_torque=rate_torque)


def _posterior(memory: Memory, index: int) -> tuple[float, float]:
    """Return mean and deviation of one number of the points, over all members."""
    values, weight = memory["mean"][:, index], memory["weight"]
    error = index - (kernel.POINT - kernel.SIZE)
    mean = float(weight @ values)
    return mean, float(np.sqrt(weight @ (memory["covariance"][:, error, error] + (values - mean) ** 2)))


def _torque_columns(pull: np.ndarray, before: Sample, sample: Sample, step: float) -> np.ndarray:
    """Return the columns (3, 12) of the torque: hook, constant, body rates and their change about each axis.

    The last stand for a wrong inertia and what is left of the rotors' lag, which the hook must not be taken for.
    """
    x, y, z = attitude.rotate_back(sample.x[Q], pull)
    cross = np.array([[0.0, z, -y], [-z, 0.0, x], [y, -x, 0.0]])  # of hook x pull over the hook
    change = (sample.x[W] - before.x[W]) / step
    return np.hstack([cross, np.eye(3), np.diag(sample.x[W]), np.diag(change)])


def _torque(
    gram: np.ndarray, right: np.ndarray, flights: Sequence[list[Sample]], reach: float
) -> tuple[np.ndarray, np.ndarray]:
    """Return the hook (3,) [m] and the torque over the body rates (3,) [N·m·s] that explain the torque best.

    The hook has a prior around Bo. What the flights do not show is zero.
    Args: reach: prior deviation of the hook [m].
    """
    torque = np.concatenate(
        [[s.chi[3:] for s in samples if np.all(np.isfinite(s.chi))] for samples in flights]
    )
    noise = np.mean(np.diff(torque, axis=0) ** 2) / 2
    prior = np.diag([noise / reach**2] * 3 + [0.0] * 9)
    found = np.linalg.lstsq(gram + prior, right, rcond=None)[0]
    return found[:3], found[6:9]
