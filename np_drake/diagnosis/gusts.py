"""Slow forces that no effect explains: are they gusts, felt through the drag that was found?

Gusts have no shape that an unseen flight would repeat; what tells them is their size, above what the sensors can have
done, and that they come and go in every direction of W. What is tied to a place, the command or the motion is
asked about first (`unknown`).
"""

import dataclasses as dc
from collections.abc import Sequence

import numpy as np
from scipy import optimize

from np_drake import attitude
from np_drake.diagnosis.answer import Cause, Estimate
from np_drake.diagnosis.evidence import FORCE, POSITION, VELOCITY, Evidence, low_pass
from np_drake.diagnosis.hidden_swing import attitude_on_grid
from np_drake.diagnosis.rig import Tolerance
from np_drake.effects.gusty_wind import GustyWind

BAND = 0.7  # of what counts as slow [Hz]; own choice
WANDERING = 0.010  # of attitude that colours a force turned with another attitude [rad]
LONGEST = 5.0  # lag of the autocovariance [s]
EXCESS = {True: 1.0, False: 2.0}  # ratio above which a slow force is real, on a rig and in a laboratory
FELT = {True: 1.0, False: 1.3}  # the same where a drag was found, through which gusts would act
SLOPE = 12.0  # of its probability; own choice


@dc.dataclass(frozen=True)
class SlowForce:
    """RMS of the slow residual force and of what sensors may have done, level axes of W [N]; their ratio squared

    is compared with one.   deviation [N], correlation_time [s] of a first-order Gauss-Markov process, (value, half
    width of the 95 % interval).
    """

    force: float
    floor: float
    deviation: tuple[float, float]
    correlation_time: tuple[float, float]

    @property
    def ratio(self) -> float:
        """Slow force over sensor floor [1]."""
        return self.force / max(self.floor, 1e-9)

    def probability(self, tolerance: Tolerance, *, felt: bool = False) -> float:
        """That something slow is there which sensors have not done.   felt: is there a drag that feels a wind?"""
        least = (FELT if felt else EXCESS)[tolerance.real]
        excess = np.clip(SLOPE * (self.ratio / least - 1), -50, 50)
        return float(1 / (1 + np.exp(-excess)))


def slow_force(flights: Sequence[Evidence], left: dict[str, np.ndarray], tolerance: Tolerance) -> SlowForce:
    """Of what is left (m, 15) of the flights."""
    forces, floors, lags, span = [], [], [], 0.0
    for e in flights:
        force = _in_world(e, left[e.name][:, FORCE])
        slow = _inside(low_pass(force - force.mean(axis=0), e.grid.step, BAND), e.grid.step)[:, :2]
        forces.append(np.mean(slow**2))
        floors.append(_floor(e, left[e.name], tolerance) ** 2)
        lags.append(_autocovariance(force[:, :2] - force[:, :2].mean(axis=0), e.grid.step))
        span += e.t[-1] - e.t[0]
    deviation, time = _gauss_markov(
        np.mean([lag[: min(map(len, lags))] for lag in lags], axis=0), flights[0].grid.step
    )
    draws = max(2.0, 2 * span / (2 * max(time, 0.1)))  # independent ones on two axes
    return SlowForce(
        float(np.sqrt(np.mean(forces))),
        float(np.sqrt(np.mean(floors))),
        (deviation, 1.96 * deviation / np.sqrt(2 * draws)),
        (time, 1.96 * time * np.sqrt(2 / draws)),
    )


def _inside(slow: np.ndarray, step: float) -> np.ndarray:
    """Without the ends, where a low-pass of differentiated noise has an edge."""
    edge = round(1 / (BAND * step))
    return slow[edge:-edge] if len(slow) > 3 * edge else slow


def _in_world(e: Evidence, force_B: np.ndarray) -> np.ndarray:
    return attitude.rotate(attitude_on_grid(e), force_B)


def _floor(e: Evidence, left: np.ndarray, tolerance: Tolerance) -> float:
    """What accelerometer, velocity and attitude may do to the slow force, one level axis [N]."""
    sensor = left[:, VELOCITY]
    if e.log.a is None:  # the velocity's own slow error, as position shows it
        sensor = np.gradient(low_pass(left[:, POSITION], e.grid.step, BAND), e.grid.step, axis=0)
    sensor = low_pass(sensor - sensor.mean(axis=0), e.grid.step, BAND)
    sensor = _inside(sensor, e.grid.step)
    accelerometer = e.vehicle.mass * float(np.sqrt(np.mean(sensor**2)))
    if tolerance.real:
        accelerometer = max(accelerometer, e.vehicle.mass * tolerance.acceleration)
    tilt = e.vehicle.mass * e.vehicle.gravity * WANDERING if tolerance.real and not e.turned else 0.0
    return float(np.hypot(accelerometer, tilt))


def _autocovariance(force: np.ndarray, step: float) -> np.ndarray:
    """(k,) mean over axes at lags 0 … `LONGEST`."""
    n, k = len(force), min(len(force) // 2, round(LONGEST / step))
    size = 2 ** int(np.ceil(np.log2(2 * n)))
    power = np.abs(np.fft.rfft(force, size, axis=0)) ** 2
    return np.fft.irfft(power, size, axis=0)[:k].mean(axis=1) / n


def _gauss_markov(lags: np.ndarray, step: float) -> tuple[float, float]:
    """Deviation and correlation time of C(tau) = s² exp(-tau / T) + c beyond the shortest lags, where noise sits."""
    tau = np.arange(len(lags)) * step
    use = tau >= 0.1
    scale = max(float(lags[use][0]), 1e-12)

    def miss(z: np.ndarray) -> np.ndarray:
        weight = 1.0 / (1.0 + tau[use])
        return weight * (z[0] * np.exp(-tau[use] / np.exp(z[1])) + z[2] - lags[use] / scale)

    fit = optimize.least_squares(
        miss, [1.0, 0.5, 0.0], bounds=([1e-3, np.log(0.1), -2.0], [10.0, np.log(15.0), 0.2])
    )
    return float(np.sqrt(fit.x[0] * scale)), float(np.exp(fit.x[1]))


def as_gusts(slow: SlowForce, causes: list[Cause], probability: float) -> list[Cause]:
    """The causes with gusts among them, where a drag was found through which they can act; else as they are.

    A steady wind among them becomes the mean of the gusts. Gusts do not repeat: they explain no unseen flight.
    """
    drag = next((c for c in causes if c.identifier == "linear_drag"), None)
    if drag is None:
        return causes
    d = float(np.mean([abs(drag.parameters[name].value) for name in ("d_x", "d_y")]))
    wind = next((c for c in causes if c.identifier == "constant_wind"), None)
    parameters = {f"mean_{axis}": _mean(wind, axis) for axis in "xyz"}
    for name, unit, (value, half), scale in (
        ("deviation", "m/s", slow.deviation, 1 / max(d, 1e-6)),
        ("correlation_time", "s", slow.correlation_time, 1.0),
    ):
        middle = scale * value
        parameters[name] = Estimate(middle, unit, (max(0.0, middle - scale * half), middle + scale * half))
    effect = GustyWind.of({name: e.value for name, e in parameters.items()})
    gusts = Cause("gusty_wind", probability, parameters, drag.onset, (), drag.share, effect)
    return [*(c for c in causes if c.identifier != "constant_wind"), gusts]


def _mean(wind: Cause | None, axis: str) -> Estimate:
    return Estimate(0.0, "m/s", (0.0, 0.0)) if wind is None else wind.parameters[axis]
