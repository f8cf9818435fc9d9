"""Oracle pendulum, which knows the payload and where it is: what a forecast could do at best, never
a predictor.
"""

import dataclasses as dc
from collections.abc import Iterable

import numpy as np

from np_drake import attitude
from np_drake.effects.pendulum import Payload, hook_velocity
from np_drake.residual_model import Memory, Plan, Sample, WrenchForecast, constant_forecast
from np_drake.residual_models.oracle import TrueModel
from np_drake.skill.skill import held_plan
from np_drake.training_data.training_segments import SampledFlight
from np_drake.vehicle import Vehicle

SUPPORT = (
    0.05  # to each side of a sample, over which position and velocity of the payload are fitted [s]
)
REST_BANDWIDTH = (
    0.3  # of the low-pass on what the pendulum leaves of the labels: it hardly changes [Hz]
)


@dc.dataclass(frozen=True)
class Rest:
    """What acts beside the tether: linear drag of the vehicle, and the rest of the labels so far,
    held.
    """

    drag: float  # force over velocity in W, against it [N s/m]


class OraclePendulum:
    """Residual model of one flight: the tether's wrench from the true payload, driven by the plan.

    Args:
        r, r_rate: (n, 3) of the payload from the hook in W, at the samples of the flight [m, m/s].
        step: between samples [s].
        rest: None: nothing but the tether.
    """

    def __init__(
        self,
        vehicle: Vehicle,
        payload: Payload,
        r: np.ndarray,
        r_rate: np.ndarray,
        *,
        step: float,
        rest: Rest | None = None,
    ):
        self.name = "oracle pendulum" if rest is None else "told + drag"
        self.payload, self.step = payload, step
        self._truth = TrueModel(vehicle, payload, [], [])
        self._r, self._r_rate, self._rest = r, r_rate, rest
        self._gain = 0.0 if rest is None else 1.0 - np.exp(-2 * np.pi * REST_BANDWIDTH * step)

    def initial_memory(self) -> Memory:
        """Return the memory before any sample.

        x: (13,) last state.
        u: (4,) last command.
        rest: (6,) held beside the tether [N, N·m].
        count, seen: (1,) samples, and labels among them.
        """
        x = np.array([0.0] * 3 + [1.0] + [0.0] * 9)
        return {
            "x": x,
            "u": np.zeros(4),
            "rest": np.zeros(6),
            "count": np.zeros(1),
            "seen": np.zeros(1),
        }

    def update(self, memory: Memory, sample: Sample) -> Memory:
        """Return the memory after one more sample; what is NaN stays as it was."""
        x, u = np.asarray(sample.x, float), np.asarray(sample.u, float)
        new = {**memory, "count": memory["count"] + 1.0}
        new["x"] = x if np.isfinite(x).all() else memory["x"]
        new["u"] = u if np.isfinite(u).all() else memory["u"]
        if self._rest is not None and memory["count"][0] and np.isfinite(sample.chi).all():
            flown = Plan(np.stack([memory["x"], new["x"]]), new["u"][None])
            left = sample.chi - self._driven(int(memory["count"][0]) - 1, flown, self.step)[0]
            gain = max(self._gain, 1.0 / (memory["seen"][0] + 1.0))
            new["rest"] = memory["rest"] + gain * (left - memory["rest"])
            new["seen"] = memory["seen"] + 1.0
        return new

    def forecast(self, memory: Memory, *, horizon: int, stride: int) -> WrenchForecast:
        """Return the forecast along `held_plan`."""
        plan = held_plan(memory["x"], memory["u"], steps=horizon, step=stride * self.step)
        return self.forecast_along(memory, plan, horizon=horizon, stride=stride)

    def forecast_along(
        self, memory: Memory, plan: Plan, *, horizon: int, stride: int
    ) -> WrenchForecast:
        """Return the wrench along the plan, from the true position of the payload at the last
        sample.
        """
        now = int(memory["count"][0]) - 1
        if now < 0:
            return constant_forecast(np.zeros(6), horizon)
        ahead = Plan(plan.x[: horizon + 1], plan.u[:horizon])
        return constant_forecast(
            memory["rest"] + self._driven(now, ahead, stride * self.step), horizon
        )

    def _driven(self, now: int, plan: Plan, step: float) -> np.ndarray:
        """Return the wrench of tether and drag along a plan that begins at sample `now`, (N, 6) [N,
        N·m].
        """
        state = (self._r[now], self._r_rate[now])
        thrust = np.zeros(4)  # of no matter: without actuator effects commands act at once
        chi = self._truth.wrench_along(plan.x, plan.u, step, rotor_thrust=thrust, swing_state=state)
        if self._rest is not None:
            chi[:, :3] -= self._rest.drag * 0.5 * (plan.x[1:, 7:10] + plan.x[:-1, 7:10])
        return chi


def oracle_pendulum(
    flight: SampledFlight,
    vehicle: Vehicle,
    payload: Payload,
    path: tuple[np.ndarray, np.ndarray],
    rest: Rest | None = None,
) -> OraclePendulum:
    """Return the pendulum of a flight whose payload was measured.

    Only the direction of the tether is taken from the position; its length is that of `payload`.

    Args:
        path: ascending times (m,) from the first sample on [s], and p_WPo (m, 3) of the payload
            [m].
        rest: what acts beside the tether; None: nothing.
    """
    place, velocity = _smoothed(flight.step * np.arange(len(flight)), *path)
    p_BoTo_W = attitude.rotate(flight.x[:, 3:7], np.broadcast_to(payload.hook, place.shape))
    away = place - flight.x[:, :3] - p_BoTo_W
    move = velocity - hook_velocity(payload.hook, flight.x)
    far = np.linalg.norm(away, axis=1, keepdims=True)
    n = away / far
    r_rate = payload.length / far * (move - np.sum(move * n, axis=1, keepdims=True) * n)
    return OraclePendulum(vehicle, payload, payload.length * n, r_rate, step=flight.step, rest=rest)


def remaining_drag(flights: Iterable[tuple[SampledFlight, OraclePendulum]]) -> float:
    """Return the drag coefficient that explains best what oracle pendulums leave of the lateral
    labels [N s/m].

    Least squares beside a constant for every flight and axis.
    """
    over, under = 0.0, 0.0
    for flight, model in flights:
        steps = [Plan(flight.x[k : k + 2], flight.u[k + 1 : k + 2]) for k in range(len(flight) - 1)]
        driven = np.array(
            [model._driven(k, plan, flight.step)[0, :2] for k, plan in enumerate(steps)]
        )
        left, v = flight.chi[1:, :2] - driven, 0.5 * (flight.x[1:, 7:9] + flight.x[:-1, 7:9])
        good = np.isfinite(left).all(axis=1)
        left, v = left[good] - left[good].mean(axis=0), v[good] - v[good].mean(axis=0)
        over, under = over - float(np.sum(left * v)), under + float(np.sum(v * v))
    return over / under if under > 0 else 0.0


def _smoothed(at: np.ndarray, t: np.ndarray, p: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return position and velocity (n, 3) at the times `at` (n,), of parabolas fitted around each
    [m, m/s].
    """
    place, velocity = np.empty((len(at), 3)), np.empty((len(at), 3))
    for k, now in enumerate(at):
        near = np.flatnonzero(np.abs(t - now) <= SUPPORT)
        if len(near) < 4:
            near = np.argsort(np.abs(t - now))[:6]
        basis = np.vander(t[near] - now, 3, increasing=True)
        place[k], velocity[k] = np.linalg.lstsq(basis, p[near], rcond=None)[0][:2]
    return place, velocity
