"""Training of a payload filter: thrust error, drag, hook and rotor lag of the vehicle, from its own
filter.
"""

import dataclasses as dc
from collections.abc import Callable, Sequence

import numpy as np

from np_drake import attitude
from np_drake.checks import require
from np_drake.flight_log import FlightLog
from np_drake.payload_filter import kernel
from np_drake.payload_filter.bank_options import BankOptions
from np_drake.payload_filter.model_file import PayloadFilterModel
from np_drake.payload_filter.predictor import RAW, PayloadFilter
from np_drake.residual_model import Memory, Sample
from np_drake.rigid_body import Q, V, W
from np_drake.rotor_input import with_rotor_lag
from np_drake.trained_model import origin_of
from np_drake.training_data.accelerations import with_accelerations
from np_drake.training_data.actuator_timing import delayed, delays_sought, learned_timing
from np_drake.training_data.segments import Flight, picked_flight, require_torque
from np_drake.vehicle import Vehicle
from np_drake.vehicle.scaling import ratios, scales

LASTING = 1e6  # memory while training: nothing returns to its prior [s]
# Of the paper's vehicle, in whose units of length and time they hold for any.
SETTLED = 5.0  # after which the pull serves to find the hook [s]; source: own choice, two swings
# prior deviation from Bo of the hook, and of the point where drag acts [m]; stated prior
HOOK = 0.1
COLUMNS = 14  # of the torque [1]
THRUST_CHANGE = 0.01  # least deviation of the thrust error between flights [1]; stated prior
DRAG_CHANGE = 0.02  # least deviation of the drag between flights [1/s]; stated prior
Flights = Sequence[tuple[FlightLog, Vehicle]]


def train_payload_filter(
    flights: Flights,
    *,
    step: float,
    prior: PayloadFilterModel | None = None,
    on_pass: Callable[[int, int], None] = lambda *_: None,
) -> PayloadFilterModel:
    """Return the model of the vehicle that flew `flights`.

    The filter runs over them, twice: the second time it knows the hook.

    Args:
        step: between samples [s].
        prior: whose bank runs and stays in the model; it holds for any vehicle in its units of
            length, mass and time. None: that from which learning starts.
        on_pass: called with (done, total).
    Raises: ValueError: if the logs are of different vehicles, or one is without torque, its labels
        or rows.
    """
    logs = [(with_accelerations(require_torque(log)), vehicle) for log, vehicle in flights]
    vehicle = logs[0][1]
    require(
        all(other == vehicle for _, other in logs),
        "payload_filter: all flights must be of one vehicle; give them one --vehicle FILE.",
    )
    lag, delay = learned_timing(logs, delays_sought(step))
    samples = [flight_samples(log, vehicle, lag, step, delay) for log, _ in logs]
    for (log, _), flight in zip(logs, samples, strict=True):
        require(
            len(torque_steps(flight)),
            f"payload_filter: flight {log.name} must have torque labels at neighbouring samples "
            "(command and angular acceleration in the same rows); got none.",
        )
    model = _untrained(vehicle, lag, step, BankOptions() if prior is None else prior.bank)
    for done in (1, 2):
        refined = _refined(model, samples)
        model = dc.replace(model, hook=refined.hook)
        on_pass(done, 2)
    summary = {
        "origin": origin_of("world", vehicle, RAW),
        "samples": sum(map(len, samples)),
        "command_delay": delay,
    }
    learned = {} if prior is None else prior.learned
    return dc.replace(refined, delay=delay, summary=summary, learned=learned)


def opened_logs(flights: Sequence[Flight]) -> Flights:
    """Return log and vehicle of opened flights.

    Raises: ValueError: if one is an array of wrenches.
    """
    logs = [
        (flight.data, flight.vehicle) for flight in flights if isinstance(flight.data, FlightLog)
    ]
    require(
        len(logs) >= len(flights),
        "train: must have flight logs, with attitude and command; got arrays of wrenches. "
        "Use mode-dictionary.",
    )
    return logs


def flight_samples(
    log: FlightLog, vehicle: Vehicle, rotor_lag: float, step: float, delay: float = 0.0
) -> list[Sample]:
    """Return what a predictor would see of a flight, a sample every `step` [s], see
    `picked_flight`.

    Args:
        rotor_lag: of a vehicle whose file names none [s].
        step: between samples [s].
        delay: of commands, before the lag [s].
    """
    log = delayed(log, delay)
    flight = picked_flight(log, with_rotor_lag(vehicle, rotor_lag), step=step, label=RAW)
    return [flight.sample(k) for k in range(len(flight))]


def _untrained(
    vehicle: Vehicle, rotor_lag: float, step: float, bank: BankOptions
) -> PayloadFilterModel:
    """Return the model before any flight, with the priors of the bank."""
    thrust = bank.thrust_error
    drag = bank.scaled(ratios(vehicle)).drag
    return PayloadFilterModel(
        step,
        vehicle.mass,
        vehicle.gravity,
        rotor_lag,
        thrust.mean,
        thrust.deviation,
        drag.mean,
        drag.deviation,
        np.zeros(3),
        arm=scales(vehicle).length,
        bank=bank,
    )


def _refined(model: PayloadFilterModel, flights: Sequence[list[Sample]]) -> PayloadFilterModel:
    """Return the model after its filter ran over the samples of all flights, one after the
    other.
    """
    gram = np.zeros((COLUMNS, COLUMNS))
    right = np.zeros(COLUMNS)
    lasting = dc.replace(model.bank, memory=(LASTING,) * model.bank.conditions)
    for samples in flights:
        predictor = PayloadFilter(dc.replace(model, bank=lasting))
        memory = predictor.initial_memory()
        for k, sample in enumerate(samples):
            memory = predictor.update(memory, sample)
            if k * model.step >= SETTLED * model.unit.time:
                X = _torque_columns(predictor.pull(memory), samples[k - 1], sample, model.step)
                if np.all(np.isfinite(X)) and np.all(np.isfinite(sample.chi)):
                    gram = gram + X.T @ X
                    right = right + X.T @ sample.chi[3:]
        thrust, thrust_deviation = _posterior(memory, kernel.THRUST_ERROR)
        drag, drag_deviation = _posterior(memory, kernel.DRAG)
        model = dc.replace(
            model,
            thrust_error=thrust,
            thrust_error_deviation=max(thrust_deviation, THRUST_CHANGE),
            drag=drag,
            drag_deviation=max(drag_deviation, DRAG_CHANGE / model.unit.time),
        )
    hook, rate_torque, speed_torque = _torque(gram, right, flights, model)
    return dc.replace(model, hook=hook, rate_torque=rate_torque, speed_torque=speed_torque)


def _posterior(memory: Memory, index: int) -> tuple[float, float]:
    """Return mean and deviation of one number of the points, over all members."""
    values = memory["mean"][:, index]
    weight = memory["weight"]
    error = index - (kernel.POINT - kernel.SIZE)
    mean = float(weight @ values)
    return mean, float(
        np.sqrt(weight @ (memory["covariance"][:, error, error] + (values - mean) ** 2))
    )


def _torque_columns(pull: np.ndarray, before: Sample, sample: Sample, step: float) -> np.ndarray:
    """Return the columns (3, 14) of the torque: hook, constant, body rates, lateral velocity,
    change of the rates.

    The velocity stands for flapping blades and drag beside Bo, the change for a wrong inertia and
    what is left of the rotors' lag; the hook must not be taken for them.
    """
    cross = attitude.skew(attitude.rotate_back(sample.x[Q], pull)).T  # of hook x pull over the hook
    change = (sample.x[W] - before.x[W]) / step
    v = attitude.rotate_back(sample.x[Q], sample.x[V])
    across = np.array([[v[1], 0.0], [0.0, v[0]], [0.0, 0.0]])
    return np.hstack([cross, np.eye(3), np.diag(sample.x[W]), across, np.diag(change)])


def _torque(
    gram: np.ndarray, right: np.ndarray, flights: Sequence[list[Sample]], model: PayloadFilterModel
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return hook (3,) [m], torque over body rates (3,) [N·m·s] and over velocity (2,) [N·s] that
    explain it best.

    The hook has a prior around Bo, and so has the point at which drag acts. What the flights do not
    show is zero.
    """
    noise = np.mean(np.concatenate([torque_steps(samples) for samples in flights]) ** 2) / 2
    hook = HOOK * model.unit.length
    drag = model.bank.drag.deviation / model.unit.time
    deviation = np.full(COLUMNS, np.inf)
    deviation[:3] = hook
    deviation[9:11] = hook * model.mass * drag
    solution = np.linalg.lstsq(gram + np.diag(noise / deviation**2), right, rcond=None)[0]
    return solution[:3], solution[6:9], solution[9:11]


def torque_steps(samples: Sequence[Sample]) -> np.ndarray:
    """Return the change of the torque label from sample to sample of a flight, where both have one,
    (n, 3) [N·m].
    """
    chi = np.array([sample.chi for sample in samples]).reshape(-1, 6)
    labelled = np.all(np.isfinite(chi), axis=1)
    return np.diff(chi[:, 3:], axis=0)[labelled[1:] & labelled[:-1]]
