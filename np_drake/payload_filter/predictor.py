"""Payload filter: a bank of pendulums, corrected by every label, that forecasts along the
controller's plan.
"""

import dataclasses as dc
from pathlib import Path

import numpy as np

from np_drake import attitude
from np_drake.compiled import compiled, finite
from np_drake.labels import RAW
from np_drake.payload_filter import kernel
from np_drake.payload_filter.actuator_lag import decays_of, initial_lag, next_lag
from np_drake.payload_filter.bank_options import Prior
from np_drake.payload_filter.filter_bank import PendulumBank
from np_drake.payload_filter.forecast import (
    Carrier,
    Timing,
    along_plan,
    beside_plan,
    drives,
    motion_torque,
)
from np_drake.payload_filter.hook import initial_shift, next_shift, torque_doubt
from np_drake.payload_filter.model_file import PAYLOAD_FILTER, PayloadFilterModel
from np_drake.residual_model import Memory, Plan, Sample, WrenchForecast
from np_drake.rigid_body import Q, W
from np_drake.rotor_input import lag_shares

# over which the noise of labels is averaged [s], as many samples of any vehicle; own choice
NOISE_TIME = 2.0
FIRST_NOISE = 0.3  # noise of a force label before any was seen [m/s²]; source: stated prior
# second difference that counts as noise, in standard deviations [1]: larger ones are events
CLIP = 4.0
LEAST_WEIGHT = 0.01  # of a member in a forecast [1]
PULL = ("mean", "weight", "now")  # of the memory, by the moments of the pull
NOISE = ("labels", "variance", "seen")  # of the memory, by the noise of the labels


class PayloadFilter:
    """Pendulums of several lengths and conditions under the vehicle, weighed by how well they
    predict the labels.

    The forecast is that of every member along the plan (mean by weight). Where the motion departs
    from the plan, the tether follows as a linear pendulum: z = [r, s] in x and y with r the
    payload's distance from the hook and s its velocity, r' = s - v, s' = -g/L r - c s, force = m
    g/L r. That system is dissipative: over any motion from rest it takes up energy from the vehicle
    and never gives back more.

    Memory: of the bank; x (13,) and acting (4,) command at the last sample; labels (2, 3) the last
    two of force and variance (3,) of their noise; steady (3,) torque that nothing here explains,
    shift (3,) of the hook and what `next_shift` needs for both; lag of the rotors and what
    `next_lag` needs; now (9,) what moves the tether;
    seen: samples so far. A sample without label, or with a NaN in it, moves the bank without
    correction; without a state it waits.

    Args:
        model: the trained vehicle, and what is believed of payload and air.
    """

    name = PAYLOAD_FILTER
    label = RAW

    def __init__(self, model: PayloadFilterModel):
        self.model = model
        self.step = model.step
        self.rotor_lag = model.rotor_lag
        self.delay = model.delay
        options = dc.replace(
            model.bank.scaled(model.unit),
            thrust_error=Prior(model.thrust_error, model.thrust_error_deviation),
            drag=Prior(model.drag, model.drag_deviation),
        )
        self.bank = PendulumBank(options, step=model.step, gravity=model.gravity)
        self._pace = self.step / model.unit.clock
        self._decays = decays_of(self.rotor_lag, self.step)
        self._noise_share = self._pace / NOISE_TIME
        self._length_unit = model.unit.length
        # step in the time unit of the paper's vehicle [s]
        self._unit_step = self.step / model.unit.time
        self._hook = np.asarray(model.hook, float)
        self._cross = attitude.skew(self._hook)

    @classmethod
    def load(cls, path: str | Path) -> "PayloadFilter":
        """Return the predictor of a model file.

        Raises: ValueError: one line, on a bad file.
        """
        return cls(PayloadFilterModel.load(path))

    def initial_memory(self) -> Memory:
        """Return the memory before any sample."""
        hovering = np.array([self.model.mass * self.model.gravity, 0.0, 0.0, 0.0])
        return {
            **self.bank.initial_memory(),
            **initial_lag(self.rotor_lag, hovering),
            "x": np.eye(13)[3],
            "acting": hovering,
            "labels": np.full((2, 3), np.nan),
            "variance": np.full(3, FIRST_NOISE**2),
            **initial_shift(self._unit_step),
            "now": np.zeros(9),
            "seen": np.zeros(1),
        }

    def update(self, memory: Memory, sample: Sample) -> Memory:
        """Return the memory after one more sample; see the class for samples with NaN."""
        x = np.asarray(sample.x, float)
        u = np.asarray(sample.u, float)
        if not finite(x):
            return memory
        u = u if finite(u) else memory["acting"]
        if not memory["seen"][0]:
            begun = {"x": x.copy(), "acting": u.copy(), "seen": np.ones(1)}
            return {**memory, **initial_lag(self.rotor_lag, u), **begun}
        mass = self.model.mass
        chi = np.asarray(sample.chi, float)
        lagged = u + self._decays * (memory["lagged"] - u)
        mean_decay, decay = lag_shares(memory["lag"][0], self.step)
        before = memory["acting"] - u
        acting = u + decay * before
        over_step = u + mean_decay * before
        # The label takes the trained lag for granted
        missing = lagged[0] - acting
        force = (chi[:3] + missing[0] * attitude.body_z(x[Q])) / mass
        drive, now = drives(
            memory["x"], x, self._hook, over_step[0] / mass, acting[0] / mass, self.step
        )
        bank = self.bank.step_on(memory, drive, now, force, memory["variance"])
        new = {**memory, **bank, "x": x.copy(), "acting": acting, "lagged": lagged, "now": now}
        if finite(chi):
            known = (memory[name] for name in NOISE)
            least = self.bank.options.least_noise
            noise = _take_noise(*known, force, self._noise_share, least)
            new |= dict(zip(NOISE, noise, strict=True))
            torque = chi[3:] - motion_torque(x, self.model.rate_torque, self.model.speed_torque)
            new |= self._lag_hook_and_level(new, torque, missing[1:])
        return new

    def _lag_hook_and_level(
        self, memory: Memory, torque: np.ndarray, missing: np.ndarray
    ) -> Memory:
        """Return the memory of lag, hook and level after a torque (3,) that body rates and velocity
        do not explain under the trained lag [N·m].

        What the members disagree about the pull is a doubt about its torque.

        Args:
            missing: (3,) what that lag makes of the command beyond the estimated one [N·m].
        """
        pull, spread = kernel.pull_moments(*(memory[name] for name in PULL))
        turn = self.model.mass * attitude.rotation_matrix(memory["x"][Q])
        pull = pull @ turn
        spread = turn.T @ spread @ turn
        doubt = torque_doubt(spread, self._cross, self._length_unit)
        rest = torque - self._cross @ pull
        lag = next_lag(
            memory,
            self.rotor_lag,
            memory["lagged"],
            rest - attitude.skew(memory["shift"]) @ pull,
            self._pace,
        )
        unit = self._length_unit
        shift = next_shift(memory, rest + missing, pull, doubt, self._unit_step, length_unit=unit)
        return {**lag, **shift}

    def pull(self, memory: Memory) -> np.ndarray:
        """Return the pull of the tether on the vehicle at the last sample, mean of all members, in
        W (3,) [N].
        """
        return self.model.mass * kernel.pull_moments(*(memory[name] for name in PULL))[0]

    def forecast(self, memory: Memory, *, horizon: int, stride: int) -> WrenchForecast:
        """Return the forecast for a motion that goes on at the velocity and attitude of now."""
        x = np.tile(memory["x"], (horizon + 1, 1))
        x[:, W] = 0.0
        plan = Plan(x, np.tile(memory["acting"], (horizon, 1)))
        return self.forecast_along(memory, plan, horizon=horizon, stride=stride)

    def forecast_along(
        self, memory: Memory, plan: Plan, *, horizon: int, stride: int
    ) -> WrenchForecast:
        """Return the forecast over `horizon` steps of `stride * self.step` seconds along a plan at
        these steps.
        """
        likely = memory["weight"] >= LEAST_WEIGHT
        weight = memory["weight"][likely] / memory["weight"][likely].sum()
        points = memory["mean"][likely]
        step = stride * self.step
        carrier = Carrier(
            self._hook + memory["shift"],
            self.model.mass,
            self.model.gravity,
            memory["steady"],
            self.model.rate_torque,
            self.model.speed_torque,
        )
        timing = Timing(step, stride, *lag_shares(memory["lag"][0], step))
        wrench = along_plan(points, weight, plan.x, plan.u, memory["acting"], carrier, timing)
        A, B, C, offset = beside_plan(weight @ points, plan.x, carrier, step, wrench)
        return WrenchForecast(A, B, C, np.zeros(4), offset)


@compiled
def _take_noise(labels, variance, seen, force, share, least):
    """Return labels, variance and seen of the memory after one more force (3,) [m/s²]; the variance
    of noise is a sixth of that of second differences.

    Args:
        labels: (2, 3) last forces, older first [m/s²].
        variance: (3,) of their noise [m²/s⁴].
        seen: (1,) samples so far.
        share: of a sample in the variance.
        least: deviation of the noise [m/s²].
    """
    square = (force - 2 * labels[1] + labels[0]) ** 2 / 6
    kept = np.empty_like(labels)
    kept[0] = labels[1]
    kept[1] = force
    if not np.isfinite(square).all():
        return kept, variance.copy(), seen.copy()
    blend = max(share, 1.0 / (2.0 + seen[0]))
    square = np.minimum(square, CLIP**2 * variance)
    return kept, np.maximum(variance + blend * (square - variance), least**2), seen + 1
