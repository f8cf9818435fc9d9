"""Motion and memory of a residual model at the instant at which the next command acts."""

import numpy as np
import scipy

from np_drake.command_delay import FINE, commands_under_way
from np_drake.mpc.dynamics import DiscreteDynamics
from np_drake.residual_model import Memory, Plan, ReadsPlan, ResidualModel, Sample
from np_drake.rotor_input import lag_shares
from np_drake.vehicle import Vehicle

NO_LABEL = np.full(6, np.nan)


class LookAhead:
    """Prediction over the time in which commands are on their way.

    The nominal dynamics go on under each command and the wrench that the model forecasts for the
    period; after each period the model takes in the predicted state as a sample without label. The
    rest of a broken period moves the state alone, so that the model's memory is up to 3 / `FINE` of
    a period older. Rotors that lag by the vehicle file act with the commands through that lag.
    Source: Smith 1957, the predictor for dead time.
    """

    def __init__(self, model: ResidualModel, vehicle: Vehicle):
        self._model = model
        self._fine = model.step / FINE
        self._mean, self._end = lag_shares(vehicle.rotor_time_constant, self._fine)
        self._dynamics = DiscreteDynamics(vehicle, self._fine)

    def __call__(
        self, memory: Memory, x: np.ndarray, sent: np.ndarray, delay: float
    ) -> tuple[Memory, np.ndarray]:
        """Return the model's memory and the state (13,) `delay` later.

        Args:
            x: (13,) measured now.
            sent: (KEPT, 4) commands, the newest first [N, N·m].
            delay: [s].
        """
        # Mean over each fine step, from rest at the oldest command
        commands = commands_under_way(sent, FINE * len(sent))
        m = self._mean
        law = ([1.0 - m, m - self._end], [1.0, -self._end])
        acting, _ = scipy.signal.lfilter(*law, commands, axis=0, zi=m * commands[:1])
        for start in range(len(commands) - round(delay / self._fine), len(commands), FINE):
            now = slice(start, start + FINE)
            u = commands[now].mean(axis=0)  # the model knows of the lag itself
            x = self._advance(x, acting[now], self._wrench(memory, x, u))
            if start + FINE <= len(commands):
                memory = self._model.update(memory, Sample(x, u, NO_LABEL))
        return memory, x

    def _advance(self, x: np.ndarray, commands: np.ndarray, chi: np.ndarray) -> np.ndarray:
        """Return the state (13,) after commands (k, 4) of a fine step each."""
        new = x
        for u in commands:
            new = self._dynamics.advance(new, u, chi)
        new[3:7] /= np.linalg.norm(new[3:7])
        return new

    def _wrench(self, memory: Memory, x: np.ndarray, u: np.ndarray) -> np.ndarray:
        """Return the wrench (6,) that the model forecasts over its next step under u [N, N·m]."""
        if isinstance(self._model, ReadsPlan):
            plan = Plan(np.stack([x, x]), u[None])
            return self._model.forecast_along(memory, plan, horizon=1, stride=1).first
        return self._model.forecast(memory, horizon=1, stride=1).first
