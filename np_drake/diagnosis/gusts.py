"""Slow forces that no effect explains: are they gusts, felt through the drag that was found?

Gusts have no shape that an unseen flight would repeat; what tells them is their size, above what the sensors can have
done, and that they come and go in every direction of W. What is tied to a place, the command or the motion is
asked about first (`unknown`).
"""

import dataclasses as dc
from collections.abc import Mapping, Sequence

import numpy as np

from np_drake import attitude
from np_drake.diagnosis.answer import Cause, Estimate
from np_drake.diagnosis.evidence import FORCE, POSITION, VELOCITY, Evidence, low_pass
from np_drake.diagnosis.hidden_swing import attitude_on_grid
from np_drake.diagnosis.rig import Tolerance
from np_drake.diagnosis.wind_statistics import WindForce, wind_force, wind_onset
from np_drake.effects.gusty_wind import GustyWind

BAND = 0.7  # of what counts as slow [Hz]; own choice
WANDERING = 0.010  # of attitude that colours a force turned with another attitude [rad]
EXCESS = {True: 1.0, False: 2.0}  # ratio above which a slow force is real, on a rig and in a laboratory
FELT = {True: 1.0, False: 1.3}  # the same where a drag was found, through which gusts would act
SLOPE = 12.0  # of its probability; own choice


@dc.dataclass(frozen=True)
class SlowForce:
    """RMS of the slow residual force and of what sensors may have done, level axes of W [N].

    Their ratio, squared, is compared with one.
    """

    force: float
    floor: float

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
    forces, floors = [], []
    for e in flights:
        force = attitude.rotate(attitude_on_grid(e), left[e.name][:, FORCE])
        slow = _inside(low_pass(force - force.mean(axis=0), e.grid.step, BAND), e.grid.step)[:, :2]
        forces.append(np.mean(slow**2))
        floors.append(_floor(e, left[e.name], tolerance) ** 2)
    return SlowForce(float(np.sqrt(np.mean(forces))), float(np.sqrt(np.mean(floors))))


def _inside(slow: np.ndarray, step: float) -> np.ndarray:
    """Without the ends, where a low-pass of differentiated noise has an edge."""
    edge = round(1 / (BAND * step))
    return slow[edge:-edge] if len(slow) > 3 * edge else slow


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


def as_gusts(
    flights: Sequence[Evidence],
    left: Mapping[str, np.ndarray],
    causes: list[Cause],
    probability: float,
    tolerance: Tolerance,
) -> list[Cause]:
    """The causes with gusts among them, where a drag was found through which they can act; else as they are.

    left: (m, 15) what the causes leave of the flights. A steady wind among them becomes the mean of the gusts, and
    with it what is left in the mean. Gusts do not repeat: they explain no unseen flight.
    """
    drag = next((c for c in causes if c.identifier == "linear_drag"), None)
    if drag is None:
        return causes
    wind = next((c for c in causes if c.identifier == "constant_wind"), None)
    force = wind_force(flights, left, drag.onset)
    onset = dict(drag.onset)
    for e in flights:
        begin = onset.get(e.name)
        if begin is not None and not tolerance.real:  # slow errors of a rig's attitude have a gust's power
            onset[e.name] = wind_onset(e, left[e.name], begin, force)
    parameters = _statistics(flights, force, drag, wind, tolerance)
    effect = GustyWind.of({name: e.value for name, e in parameters.items()})
    gusts = Cause("gusty_wind", probability, parameters, onset, (), drag.share, effect)
    felt = dc.replace(drag, onset=onset)
    return [felt if c is drag else c for c in causes if c is not wind] + [gusts]


def _statistics(
    flights: Sequence[Evidence], force: WindForce, drag: Cause, wind: Cause | None, tolerance: Tolerance
) -> dict[str, Estimate]:
    """Figures of the wind [m/s, s] from those of its force: a drag is known to a share, a rig's axes to an angle."""
    d = np.array([max(abs(drag.parameters[f"d_{axis}"].value), 1e-6) for axis in "xyz"])
    level = float(d[:2].mean())
    known = max(_half(drag.parameters[f"d_{axis}"]) for axis in "xy") / level
    weight = flights[0].vehicle.mass * flights[0].vehicle.gravity
    tilt = tolerance.attitude / np.sqrt(len(flights))
    off = weight * 1.96 * np.array([tilt, tilt, np.hypot(tolerance.mass, tolerance.thrust)])
    out = {}
    for i, axis in enumerate("xyz"):
        steady = 0.0 if wind is None else wind.parameters[axis].value
        value = steady + force.mean[i, 0] / d[i]
        half = float(np.linalg.norm([force.mean[i, 1] / d[i], off[i] / d[i], known * value]))
        out[f"mean_{axis}"] = Estimate(float(value), "m/s", (float(value) - half, float(value) + half))
    value, lower, upper = force.deviation
    wider = [float(np.exp(np.hypot(np.log(end / value), known))) for end in (lower, upper)]
    out["deviation"] = Estimate(value / level, "m/s", (value / level / wider[0], value / level * wider[1]))
    out["correlation_time"] = Estimate(force.correlation_time[0], "s", force.correlation_time[1:])
    return out


def _half(estimate: Estimate) -> float:
    return 0.5 * (estimate.ci95[1] - estimate.ci95[0])
