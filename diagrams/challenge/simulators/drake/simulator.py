"""The simulator `drake`: an exact log of one planned flight with effects."""

from collections.abc import Sequence

import numpy as np

from diagrams.challenge.simulators.drake.closed_loop import DrakeLoop
from diagrams.challenge.simulators.flight_plan import Plan
from np_drake.effects.base import Effect, Measurement, SensorEffect
from np_drake.flight_log import FlightLog
from np_drake.logs.clock import shift_state
from np_drake.vehicle import Vehicle

WARM_UP = 4.0  # hovering before the first row, in which integrators settle [s]
MARGIN = 0.3  # flown after the last row, for clocks that are off [s]


def fly(
    vehicle: Vehicle,
    plan: Plan,
    effects: Sequence[Effect] = (),
    *,
    t: np.ndarray,
    onset: float | None = None,
    background: Sequence[Effect] = (),
    warm_up: float = WARM_UP,
    noise: np.ndarray | None = None,
) -> FlightLog:
    """Return the exact log: no noise; systematic sensor effects and the right-sided accelerations
    are in it.

    Args:
        t: (n,) instants of the rows [s]; the command is updated there too.
        onset: the effects act from the first row at or after it on [s]; None: from the start.
        background: effects that act throughout and are no cause (a vehicle file that is a percent
            off).
        warm_up: hovering before the first row [s].
        noise: (13,) standard deviations of white noise in the state that the controller sees; None:
            it sees the state.
    Raises: FailedRun: if the vehicle is lost.
    """
    step = float(np.median(np.diff(t)))
    before = t[0] - step * np.arange(round(warm_up / step), 0, -1)
    after = t[-1] + step * np.arange(1, round(MARGIN / step) + 1)
    rows = np.concatenate([before, t, after])
    errors = (
        None if noise is None else np.random.default_rng(0).normal(size=(len(rows), 13)) * noise
    )
    signals = _signals(
        vehicle, plan, [*background, *effects], list(background), rows, onset, errors
    )
    speed = np.sqrt(np.maximum(signals["nominal_thrust"], 0.0) / vehicle.thrust_coefficient)
    reading = Measurement(signals["x"], signals["a"], signals["al"], speed)
    sensors = [effect for effect in effects if isinstance(effect, SensorEffect)]
    for sensor in sensors:
        reading = sensor.measure(vehicle, reading, np.zeros((len(rows), sensor.white_size)))
    p, q, v, w = np.split(reading.x, [3, 7, 10], axis=1)
    log = FlightLog(rows, p, q, v, w, signals["u"], reading.a, reading.al, reading.rotor)
    for sensor in sensors:
        if sensor.clock_shift:
            log = shift_state(log, sensor.clock_shift)
    first = int(np.searchsorted(log.t, t[0] - 1e-9))
    return log.rows(first, first + len(t))


def _signals(vehicle, plan, effects, background, t, onset, noise) -> dict[str, np.ndarray]:
    """Return the signals of one phase, or of two: before the onset without the effects."""
    targets, end = plan.targets(vehicle.gravity, t), t[-1] + (t[-1] - t[-2])
    x = np.concatenate([plan.start(vehicle.gravity), np.zeros(6)])
    split = 0 if onset is None else int(np.searchsorted(t, onset - 1e-9))
    if split in (0, len(t)):
        loop = DrakeLoop(vehicle, effects if split == 0 else background)
        loop.start(t[0], x)
        return loop.fly(t, targets, end, noise)
    first, second = DrakeLoop(vehicle, background), DrakeLoop(vehicle, effects)
    first.start(t[0], x)
    before, after = (None, None) if noise is None else (noise[:split], noise[split:])
    early = first.fly(t[:split], targets[:split], t[split], before)
    second.start(t[split], first.state(), first)
    late = second.fly(t[split:], targets[split:], end, after)
    return {name: np.concatenate([early[name], late[name]]) for name in early}
