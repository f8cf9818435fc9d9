"""What the input of the logs leaves open: the scale and curve of a throttle, and when a row's command acts."""

import dataclasses as dc
from collections.abc import Sequence

import numpy as np

from np_drake.diagnosis.forward_model import Term, predicted_residual
from np_drake.diagnosis.numerics import fit_noise
from np_drake.diagnosis.options import Options
from np_drake.diagnosis.residuals import FlightResiduals
from np_drake.effects.clock_offset import ClockOffset

THROTTLE_SCALE = 0.2  # of thrust over throttle [1]; source: own choice, hover throttles are known to a fifth
ROTOR_SPEED_SCALE = (
    0.02  # of thrust over rotor speed squared [1]; source: density of air, 2 % for 6 K or 20 hPa
)
THROTTLE_CURVE = 0.3  # of its exponent, once it is fitted [1]; source: own choice
THROTTLE_DRIFT = 0.002  # of thrust over throttle [1/s]; source: own choice, a tenth in a minute
MOUNTING = 0.02  # of an autopilot's axes [rad]; source: own choice, one degree
EARLY = (
    3.0  # deviations by which motion is ahead of commands, from which these are not held from their row [1]
)
LATENCY = 0.01  # of an estimator's attitude [s]; source: own choice, a few samples of its filters


def with_input(options: Options, flights: Sequence[FlightResiduals]) -> Options:
    """Return the options whose tolerance holds what vehicle file and input of these flights leave open."""
    tolerance = options.tolerance.with_vehicle(flights[0].vehicle)
    timing = command_timing(flights)
    open_ = {"timing": max(tolerance.timing, timing)}
    if flights[0].measured_rotors:
        open_["thrust"] = max(tolerance.thrust, ROTOR_SPEED_SCALE)
    if flights[0].log.input == "normalised":
        open_ |= {
            "thrust": max(tolerance.thrust, THROTTLE_SCALE),
            "throttle_curve": max(tolerance.throttle_curve, THROTTLE_CURVE),
            "throttle_drift": max(tolerance.throttle_drift, THROTTLE_DRIFT),
            "mounting": max(tolerance.mounting, MOUNTING),
            "latency": max(tolerance.latency, LATENCY),
        }
    return dc.replace(options, tolerance=dc.replace(tolerance, **open_))


def command_timing(flights: Sequence[FlightResiduals]) -> float:
    """Return the deviation of the time at which a row's command acts [s].

    It is what the logs state, or half a row where the flights show that the command of a row does not act from it until
    the next: so a command looks that changed between the rows, as in a log of which rows were left out. Lags and delays
    look the other way. A vehicle file can state that commands are held (`command_timing: held`).
    """
    if flights[0].measured_rotors:
        return 0.0
    stated = max(e.log.timing for e in flights)
    if flights[0].vehicle.command_timing == "held":
        return stated
    half = 0.5 * max(e.log.step for e in flights)
    shift, deviation = _early(flights, 0.5 * half)
    sampled = shift > EARLY * deviation and shift - 2 * deviation < half
    return max(stated, half) if sampled else stated


def _early(flights: Sequence[FlightResiduals], step: float) -> tuple[float, float]:
    """Return the time by which motion is ahead of the commands, and its standard deviation [s].

    Generalised least squares on the residual with all else in its noise.   step: of the finite difference [s].
    """
    noise = fit_noise([e.y for e in flights], flights[0].grid.step)
    power = product = 0.0
    for e in flights:
        column = predicted_residual(e, [Term(ClockOffset(step))])
        column[:, 6:] = 0.0  # the commands alone
        white = noise.whiten(np.stack([column, e.y], axis=-1), e.name)
        power += float(np.sum(white[..., 0] ** 2))
        product += float(np.sum(white[..., 0] * white[..., 1]))
    if power == 0.0:
        return 0.0, np.inf
    return step * product / power, step / np.sqrt(power)
