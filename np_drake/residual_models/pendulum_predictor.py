"""Predictor that carries a bank of pendulums, corrected by every label, and forecasts along the controller's plan."""

import dataclasses as dc
from functools import lru_cache
from pathlib import Path

import numpy as np

from np_drake import attitude
from np_drake.effects.pendulum import hook_velocity, swing_many
from np_drake.labels import LabelConfig
from np_drake.residual_models import pendulum_kernel as kernel
from np_drake.residual_models.base import Memory, Plan, Sample, WrenchForecast
from np_drake.residual_models.pendulum_bank import BankOptions, PendulumBank, Prior
from np_drake.residual_models.pendulum_model import PENDULUM, PendulumModel
from np_drake.rigid_body import Q, V, W

RAW = LabelConfig(force_bandwidth=np.inf, torque_bandwidth=np.inf)  # the filter wants white noise
NOISE_TIME = 2.0  # over which the noise of labels is averaged [s]; own choice
STEADY_BAND = 1.0  # of the low-pass on torque that is not the tether's: that of held torque labels [Hz]
DEFAULT_BANK = BankOptions()
FIRST_NOISE = 0.3  # noise of a force label before any was seen [m/s²]; source: stated prior
CLIP = 4.0  # second difference that counts as noise, in standard deviations [1]: larger ones are events
LEAST_WEIGHT = 0.01  # of a member in a forecast [1]


class PendulumPredictor:
    """Pendulums of several lengths under the vehicle, in still and in gusty air, weighed by how they foretell labels.

    The forecast is that of every member along the plan (mean by weight). Where the motion departs from the plan, the
    tether follows as a linear pendulum: z = [r, s] in x and y with r the payload's distance from the hook and s its
    velocity, r' = s - v, s' = -g/L r - c s, force = m g/L r. That system is dissipative: over any motion from rest it
    takes up energy from the vehicle and never gives back more.

    Memory: of the bank; x (13,) and acting (4,) command at the last sample; labels (2, 3) the last two of force and
    variance (3,) of their noise; steady (3,) torque that is not the tether's; now (9,) what moves the tether; seen:
    samples so far.
    A sample without label, or with a NaN in it, moves the bank without correction; without a state it waits.
    """

    name = f"np-{PENDULUM}"
    label = RAW

    def __init__(self, model: PendulumModel, options: BankOptions = DEFAULT_BANK):
        self.model, self.step, self.rotor_lag = model, model.step, model.rotor_lag
        options = dc.replace(
            options,
            thrust_error=Prior(model.thrust_error, model.thrust_error_deviation),
            drag=Prior(model.drag, model.drag_deviation),
        )
        self.bank = PendulumBank(options, step=model.step, gravity=model.gravity)
        self._hook = np.asarray(model.hook, float)
        self._blend = 1.0 - np.exp(-2 * np.pi * STEADY_BAND * model.step)

    @classmethod
    def load(cls, path: str | Path) -> "PendulumPredictor":
        """Return the predictor of a model file.

        Raises: ValueError: one line, on a bad file.
        """
        return cls(PendulumModel.load(path))

    def initial_memory(self) -> Memory:
        """Return the memory before any sample."""
        x = np.zeros(13)
        x[3] = 1.0
        return {
            **self.bank.initial_memory(),
            "x": x,
            "acting": np.array([self.model.mass * self.model.gravity, 0.0, 0.0, 0.0]),
            "labels": np.full((2, 3), np.nan),
            "variance": np.full(3, FIRST_NOISE**2),
            "steady": np.zeros(3),
            "now": np.zeros(9),
            "seen": np.zeros(1),
        }

    def update(self, memory: Memory, sample: Sample) -> Memory:
        """Return the memory after one more sample; see the class for samples with NaN."""
        x, u = np.asarray(sample.x, float), np.asarray(sample.u, float)
        if not np.all(np.isfinite(x)):
            return memory
        if not np.all(np.isfinite(u)):
            u = memory["acting"]
        if not memory["seen"][0]:
            return {**memory, "x": x.copy(), "acting": u.copy(), "seen": np.ones(1)}
        mean_decay, decay = _lag(self.rotor_lag, self.step)
        before = memory["acting"] - u
        acting, over_step = u + decay * before, u + mean_decay * before
        drive, now = self._drives(memory["x"], x, float(over_step[0]), float(acting[0]))
        chi = np.asarray(sample.chi, float)
        force = chi[:3] / self.model.mass
        bank = self.bank.step_on(memory, drive, now, force, memory["variance"])
        new = {**memory, **bank, "x": x.copy(), "acting": acting, "now": now}
        if np.all(np.isfinite(chi)):
            new |= self._noise(memory, force)
            other = chi[3:] - np.cross(self._hook, attitude.rotate_back(x[Q], self.pull(new)))
            new["steady"] = memory["steady"] + self._blend * (other - memory["steady"])
        return new

    def pull(self, memory: Memory) -> np.ndarray:
        """Return the pull of the tether on the vehicle at the last sample, mean of all members, in W (3,) [N]."""
        return self.model.mass * (memory["weight"] @ kernel.pulls(memory["mean"], memory["now"]))

    def _drives(
        self, before: np.ndarray, x: np.ndarray, over_step: float, now: float
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return what moves the pendulums over the last step and at its end, (9,) each, see `filter_bank`."""
        turning = [hook_velocity(self._hook, y) - y[V] for y in (before, x)]
        z = np.array([attitude.body_z(before[Q]), attitude.body_z(x[Q])])
        turn = (turning[1] - turning[0]) / self.step
        v = np.array([before[V] + turning[0], x[V] + turning[1]])
        drive = np.concatenate([over_step / self.model.mass * 0.5 * (z[0] + z[1]), 0.5 * (v[0] + v[1]), turn])
        return drive, np.concatenate([now / self.model.mass * z[1], v[1], turn])

    def _noise(self, memory: Memory, force: np.ndarray) -> Memory:
        """Return the labels and the variance of their noise: a sixth of that of second differences."""
        labels = np.vstack([memory["labels"][1], force])
        square = (force - 2 * memory["labels"][1] + memory["labels"][0]) ** 2 / 6
        if not np.all(np.isfinite(square)):
            return {"labels": labels}
        seen = memory["seen"] + 1
        blend = max(self.step / NOISE_TIME, 1.0 / (1.0 + seen[0]))
        square = np.minimum(square, CLIP**2 * memory["variance"])
        variance = memory["variance"] + blend * (square - memory["variance"])
        return {
            "labels": labels,
            "variance": np.maximum(variance, self.bank.options.least_noise**2),
            "seen": seen,
        }

    def forecast(self, memory: Memory, *, horizon: int, stride: int) -> WrenchForecast:
        """Return the forecast for a motion that goes on at the velocity and attitude of now."""
        x = np.tile(memory["x"], (horizon + 1, 1))
        x[:, W] = 0.0
        plan = Plan(x, np.tile(memory["acting"], (horizon, 1)))
        return self.forecast_along(memory, plan, horizon=horizon, stride=stride)

    def forecast_along(self, memory: Memory, plan: Plan, *, horizon: int, stride: int) -> WrenchForecast:
        """Return the forecast over `horizon` steps of `stride * self.step` seconds along a plan at these steps."""
        weight = np.where(memory["weight"] >= LEAST_WEIGHT, memory["weight"], 0.0)
        some = np.flatnonzero(weight)
        weight = weight[some] / weight[some].sum()
        points = memory["mean"][some]
        step, mass = stride * self.step, self.model.mass
        middle = 0.5 * (plan.x[1:, Q] + plan.x[:-1, Q])
        middle /= np.linalg.norm(middle, axis=1, keepdims=True)
        mean = weight @ points

        pull = mass * self._pulls(points, weight, plan, step, stride)
        wrench = np.concatenate([pull, np.cross(self._hook, attitude.rotate_back(middle, pull))], axis=1)
        lag, _acting = self._acting(memory["acting"], plan.u, step)
        z = attitude.body_z(middle)
        error = mean[kernel.THRUST_ERROR]
        wrench[:, :3] += ((1.0 + error) * lag[:, :1] + error * plan.u[:, :1]) * z
        wrench[:, :3] += mass * mean[kernel.PUSH : kernel.PUSH + 3]
        wrench[:, :3] -= 0.5 * mass * mean[kernel.DRAG] * (plan.x[1:, V] + plan.x[:-1, V])
        wrench[:, 3:] += lag[:, 1:] + memory["steady"]
        return self._about(wrench, mean, points, weight, plan.x, step)

    def _pulls(self, points, weight, plan: Plan, step: float, stride: int) -> np.ndarray:
        """Return the mean pull of the tether over each step of the plan, (N, 3) [m/s²]."""
        length = np.exp(points[:, kernel.LOG_LENGTH])
        n, e = points[:, kernel.TETHER], points[:, kernel.ACROSS]
        rate = points[:, 6:7] * e + points[:, 7:8] * np.cross(n, e)
        v = hook_velocity(self._hook, plan.x)
        a = np.repeat(np.diff(v, axis=0) / step, stride, axis=0)
        within = (np.arange(stride) + 0.5) / stride
        passing = (v[:-1, None] + within[:, None] * (v[1:] - v[:-1])[:, None]).reshape(-1, 3)
        found = swing_many(
            length, length[:, None] * n, length[:, None] * rate, a, self.step, self.model.gravity,
            damping=np.maximum(points[:, kernel.DAMPING], 0.0), v_hook=passing,
        )  # fmt: skip
        shares = weight * points[:, kernel.MASS]
        return np.einsum("nmk,m->nk", found, shares).reshape(-1, stride, 3).mean(axis=1)

    def _acting(self, acting: np.ndarray, u: np.ndarray, step: float) -> tuple[np.ndarray, np.ndarray]:
        """Return what the rotors give beyond the planned commands, the mean of each step (N, 4), and after the last."""
        mean_decay, decay = _lag(self.rotor_lag, step)
        missing = np.empty_like(u)
        state = acting
        for i, command in enumerate(u):
            missing[i] = state - command
            state = command + decay * missing[i]
        return mean_decay * missing, state

    def _about(self, wrench, mean, points, weight, x: np.ndarray, step: float) -> WrenchForecast:
        """Return the forecast of `wrench` (N, 6) along x, with the linear pendulum for what departs from it."""
        mass = max(float(mean[kernel.MASS]), 0.0)
        stiffness = self.model.gravity / np.exp(mean[kernel.LOG_LENGTH])
        A, B, gain = linear_pendulum(stiffness, max(float(mean[kernel.DAMPING]), 0.0), step)
        C = np.zeros((6, 4))
        C[0, 0] = C[1, 1] = self.model.mass * mass * stiffness
        C[3:] = np.cross(self._hook, attitude.rotate_back(np.tile(x[0, Q], (4, 1)), C[:3].T)).T
        nominal, z = np.zeros((len(wrench), 4)), np.zeros(4)
        for i in range(1, len(wrench)):
            z = A @ z + gain * np.tile(x[i - 1, 7:9], 2)
            nominal[i] = z
        return WrenchForecast(A, B, C, np.zeros(4), wrench - nominal @ C.T)


def linear_pendulum(
    stiffness: float, damping: float, step: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return A (4, 4), B (4, 6) and its gain (4,) of v, of z = [r_x, r_y, s_x, s_y] under a velocity held over `step`.

    r' = s - v, s' = -stiffness r - damping s.   Closed form of the matrix exponential.
    Args: stiffness: g / L [1/s²].   damping: [1/s]; no more than the critical one counts.   step: [s].
    """
    half = min(0.5 * damping, 0.99 * np.sqrt(stiffness))
    rate = np.sqrt(stiffness - half**2)
    near, side = np.exp(-half * step) * np.cos(rate * step), np.exp(-half * step) * np.sin(rate * step) / rate
    a = np.array([[near + half * side, side], [-stiffness * side, near - half * side]])
    settled = np.array([2 * half / stiffness, -1.0])  # M^-1 [-1, 0] of M = [[0, 1], [-stiffness, -2 half]]
    gain = (a - np.eye(2)) @ settled
    A = np.kron(a, np.eye(2))
    B = np.zeros((4, 6))
    B[0, 0] = B[1, 1] = gain[0]
    B[2, 0] = B[3, 1] = gain[1]
    return A, B, np.repeat(gain, 2)


@lru_cache(maxsize=16)
def _lag(time_constant: float, step: float) -> tuple[float, float]:
    """Return the share of a difference that a first-order lag leaves: mean over a step, and at its end [1]."""
    if time_constant <= 0.0:
        return 0.0, 0.0
    decay = float(np.exp(-step / time_constant))
    return time_constant / step * (1.0 - decay), decay
