"""All constraints of multiple shooting in one vector: dynamics, wrench, soft sets; with a hand-written Jacobian."""

import itertools
from typing import Any

import numpy as np

from np_drake.mpc.condensed import Condensed, Trajectory
from np_drake.mpc.horizon import Horizon
from np_drake.mpc.objective import KINDS, TERMINAL, TILT, VELOCITY


class StackedStages:
    """Layout of values and rows of multiple shooting.

    Values: [u (4N), x_1 … x_N (13N), chi (6N), s (3)].   Rows: [x defects 13N, chi defects 6N, soft 7N+1].
    """

    def __init__(self, condensed: Condensed):
        self._c, self._n = condensed, condensed.config.horizon
        cuts = np.cumsum([0, 4 * self._n, 13 * self._n, 6 * self._n, KINDS]).tolist()
        self.u, self.x, self.chi, self.s = (slice(a, b) for a, b in itertools.pairwise(cuts))
        self.size = cuts[-1]

    def x_stage(self, i: int) -> slice:
        """Return the slice of x_i in the values, i = 1 … N."""
        return slice(self.x.start + 13 * (i - 1), self.x.start + 13 * i)

    def pack(self, t: Trajectory) -> np.ndarray:
        """Return the values of a rollout."""
        return np.concatenate([t.u.ravel(), t.x[1:].ravel(), t.chi.ravel(), t.slacks])

    def bounds(self) -> tuple[np.ndarray, np.ndarray]:
        """Return (lower, upper) of the rows: defects vanish, soft rows are not positive."""
        upper = np.zeros(26 * self._n + 1)
        lower = np.concatenate([np.zeros(19 * self._n), np.full(7 * self._n + 1, -np.inf)])
        return lower, upper

    def pattern(self) -> np.ndarray:
        """Return where the Jacobian can be nonzero, (rows, size), from its value at a random point."""
        n, rng = self._n, np.random.default_rng(0)
        h = Horizon(
            x0=rng.normal(size=13),
            x_ref=rng.normal(size=(n + 1, 13)),
            u_ref=rng.normal(size=(n, 4)),
            P=np.eye(13) + np.ones((13, 13)),
            P_root=np.eye(13),
            free=rng.normal(size=(n, 6)),
            markov=rng.normal(size=(6, 6 * (n - 1))),
            reaction=_Dense(),
        )
        return self.evaluate(h, rng.normal(size=self.size))[1] != 0

    def evaluate(self, h: Horizon, values: np.ndarray) -> tuple[Any, np.ndarray]:
        """Return the rows (26N+1,) and their Jacobian (26N+1, size), in physical units."""
        n = self._n
        u, chi, s = values[self.u].reshape(n, 4), values[self.chi].reshape(n, 6), values[self.s]
        x = np.vstack([h.x0, values[self.x].reshape(n, 13)])
        J = np.zeros((26 * n + 1, self.size))
        motion = self._motion(x, u, chi, J[: 13 * n])
        wrench = self._wrench(h, x, chi, J[13 * n : 19 * n])
        return np.concatenate([motion, wrench, self._soft(h, x, s, J[19 * n :])]), J

    def _motion(self, x: np.ndarray, u: np.ndarray, chi: np.ndarray, J: np.ndarray) -> np.ndarray:
        model = self._c.dynamics.linearise(x[:-1], u, chi)
        for i in range(self._n):
            rows = J[13 * i : 13 * i + 13]
            rows[:, 4 * i : 4 * i + 4] = -model.Fu[i]
            rows[:, self.chi.start + 6 * i :][:, :6] = -model.Fx[i][:, 13:]
            rows[:, self.x_stage(i + 1)] = np.eye(13)
            if i:
                rows[:, self.x_stage(i)] = -model.Fx[i][:, :13]
        return (x[1:] - model.x_next).ravel()

    def _wrench(self, h: Horizon, x: np.ndarray, chi: np.ndarray, J: np.ndarray) -> np.ndarray:
        forecast = h.free.copy()
        J[:, self.chi] = np.eye(6 * self._n)
        for i in range(1, self._n if h.markov.size else 1):
            blocks = h.markov[:, -6 * i :]
            forecast[i] += blocks @ x[:i, 7:13].ravel()
            for j in range(1, i):
                J[6 * i : 6 * i + 6, self.x_stage(j)][:, 7:13] = -blocks[:, 6 * j : 6 * j + 6]
        if h.reaction is not None:
            zeta = x[:-1, 7:13]
            forecast += h.reaction(zeta)
            own = h.reaction.jacobian(zeta)
            for i in range(1, self._n):
                J[6 * i : 6 * i + 6, self.x_stage(i)][:, 7:13] -= own[i]
        return (chi - forecast).ravel()

    def _soft(self, h: Horizon, x: np.ndarray, s: np.ndarray, J: np.ndarray) -> np.ndarray:
        """Return rows of velocity from above and below (6N), tilt (N) and terminal ellipsoid."""
        n, objective = self._n, self._c.objective
        v, box = x[1:, 7:10].ravel(), self._c.config.max_speed + s[VELOCITY]
        excess = objective.excess(h, x)
        for i in range(n):
            at = self.x_stage(i + 1).start
            J[3 * i : 3 * i + 3, at + 7 : at + 10] = np.eye(3)
            J[3 * (n + i) : 3 * (n + i) + 3, at + 7 : at + 10] = -np.eye(3)
            J[6 * n + i, at + 3 : at + 7] = 2 * x[i + 1, 3:7] * [-1.0, 1.0, 1.0, -1.0]
        e = x[-1] - h.x_ref[-1]
        J[-1, self.x_stage(n)] = e @ h.P / (h.P[0, 0] * objective.terminal_norm(h, x[-1]))
        for rows, kind in (
            (slice(0, 6 * n), VELOCITY),
            (slice(6 * n, 7 * n), TILT),
            (slice(-1, None), TERMINAL),
        ):
            J[rows, self.s.start + kind] = -1.0
        tilt, far = excess[3 * n : -1] - s[TILT], excess[-1] - s[TERMINAL]
        return np.concatenate([v - box, -v - box, tilt, [far]])


class _Dense:
    """Reaction of every component to every other, for the pattern."""

    def __call__(self, zeta: np.ndarray) -> np.ndarray:
        return np.tile(zeta.sum(axis=-1, keepdims=True), 6)

    def jacobian(self, zeta: np.ndarray) -> np.ndarray:
        return np.ones((len(zeta), 6, 6))
