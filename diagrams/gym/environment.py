"""Gymnasium environment of a tracking experiment, on Drake's own wrapper."""

import warnings
from typing import Any

import numpy as np
from gymnasium.error import ResetNeeded
from gymnasium.spaces import Box
from pydrake.gym import DrakeGymEnv

from diagrams.gym.simulator import SimulatorPool
from np_drake.control.tracking_task import ACTION_SIZE


class TrackingEnv(DrakeGymEnv):
    """Tracking with a command that a policy chooses (see `diagrams.gym.registration.make_env`).

    All randomness of an episode, its simulator and its noise, is drawn from `np_random`, so `reset(seed=…)` fixes it
    whatever was flown before.
    """

    metadata: dict[str, Any] = {"render_modes": []}

    def __init__(self, pool: SimulatorPool):
        self.pool, self._flight, self._index, self._step = pool, pool[0], 0, 0
        size = self._flight.task.observation_size
        super().__init__(
            simulator=self._choose,
            time_step=self._flight.period,
            action_space=Box(-1.0, 1.0, (ACTION_SIZE,), np.float32),
            observation_space=Box(-np.inf, np.inf, (size,), np.float64),
            reward=lambda system, context: self._flight.reward(context),
            action_port_id="action",
            observation_port_id="observation",
            reset_handler=self._start,
        )
        self.metadata, self.render_mode = {"render_modes": []}, None  # Drake's own would need a visualizer

    def _choose(self, generator):
        self._index = int(self.np_random.integers(len(self.pool)))
        self._flight = self.pool[self._index]
        return self._flight.simulator

    def _start(self, simulator, context, seed) -> None:
        self._step = 0
        self._flight.start(context, int(self.np_random.integers(2**31)))

    def reset(self, *, seed: int | None = None, options: dict | None = None):
        """Begin an episode and return its first observation and info.

        Args:
            seed: of all randomness from now on; None: it goes on.
            options: without influence.
        """
        observation, _ = super().reset(seed=seed, options=options)
        return observation, self._info()

    def step(self, action):
        """Advance by one decision.

        Args: action: (4,) in [-1, 1], clipped to it.
        Returns: observation, reward [s], terminated: vehicle lost, truncated: end of the experiment, info.
        Raises: ValueError: if an action is not four finite numbers.   ResetNeeded: before the first `reset`.
        """
        if self.simulator is None:
            raise ResetNeeded("TrackingEnv: step must follow a reset; call reset() first.")
        action = np.asarray(action, float)
        if action.shape != (ACTION_SIZE,) or not np.isfinite(action).all():
            raise ValueError(f"TrackingEnv: action must be {ACTION_SIZE} finite numbers in [-1, 1]; got {action}.")
        self._step += 1
        # To a whole multiple of the period, where sums of it would drift off the events of the diagram.
        self.time_step = self._step * self._flight.period - self.simulator.get_context().get_time()
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # Drake's on an integrator that gives up, said in `info` here
            observation, reward, _, failed, _ = super().step(np.clip(action, -1.0, 1.0))
        why = "the integrator gave up" if failed else self._flight.loss(self.simulator.get_context())
        truncated = not why and self._step >= self._flight.decisions
        info = self._info() | ({"lost": why} if why else {})
        return observation, 0.0 if why else float(reward), bool(why), truncated, info

    def _info(self) -> dict[str, Any]:
        """Return time [s], distance from the reference [m] and number of the simulator."""
        context = self.simulator.get_context()
        distance = float(np.linalg.norm(self._flight.error(context)))
        return {"time": context.get_time(), "distance": distance, "simulator": self._index}
