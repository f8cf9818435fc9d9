"""Motion and memory of a residual model at the instant at which the next command acts."""

import numpy as np

from np_drake.command_delay import FINE, acting_commands
from np_drake.mpc.dynamics import DiscreteDynamics
from np_drake.residual_models.base import Memory, Plan, ReadsPlan, ResidualModel, Sample
from np_drake.vehicle import Vehicle

NO_LABEL = np.full(6, np.nan)


class LookAhead:
    """Prediction over the time in which commands are on their way.

    The nominal dynamics go on under each command and the wrench that the model forecasts for it; the model takes in the
    predicted state as a sample without label. Over the rest of a broken period it takes in nothing.
    Source: Smith 1957, the predictor for dead time.

    Args: vehicle: nominal.   step: between samples [s].
    """

    def __init__(self, model: ResidualModel, vehicle: Vehicle):
        self._model, self._step = model, model.step
        self._dynamics = [DiscreteDynamics(vehicle, k * model.step / FINE) for k in range(1, FINE + 1)]

    def __call__(
        self, memory: Memory, x: np.ndarray, sent: np.ndarray, delay: float
    ) -> tuple[Memory, np.ndarray]:
        """Return the model's memory and the state (13,) after `delay` [s].

        Args: x: (13,) measured.   sent: (KEPT, 4) commands, the newest first [N, N·m].
        """
        periods = round(FINE * delay / self._step) / FINE
        for u in acting_commands(sent, periods)[1:]:
            x = self._advance(memory, x, u, FINE)
            memory = self._model.update(memory, Sample(x, u, NO_LABEL))
        rest = round(FINE * (periods % 1.0))
        return memory, self._advance(memory, x, sent[0], rest) if rest else x

    def _advance(self, memory: Memory, x: np.ndarray, u: np.ndarray, parts: int) -> np.ndarray:
        """Return the state after `parts` of a period under u."""
        chi = self._wrench(memory, x, u)
        new = np.array(self._dynamics[parts - 1].advance(x.tolist(), u.tolist(), chi.tolist()))
        new[3:7] /= np.linalg.norm(new[3:7])
        return new

    def _wrench(self, memory: Memory, x: np.ndarray, u: np.ndarray) -> np.ndarray:
        """Return the wrench (6,) that the model forecasts over its next step under u [N, N·m]."""
        if isinstance(self._model, ReadsPlan):
            plan = Plan(np.stack([x, x]), u[None])
            return self._model.forecast_along(memory, plan, horizon=1, stride=1).first
        return self._model.forecast(memory, horizon=1, stride=1).first
