"""Control loop of a recorded flight, replayed with a clock."""

from collections.abc import Callable

import numpy as np

from diagrams.loop.controllers import make_residual_model
from diagrams.loop.flight_result import FlightResult
from np_drake.labels import LabelFilter, labelled
from np_drake.mpc.controller import MpcController
from np_drake.mpc.solvers import make_solver
from np_drake.residual_model import Memory, Sample, WrenchForecast


class ControlLoop:
    """Label filter, residual model and MPC of a recorded flight, fed with its readings outside a
    simulator.
    """

    def __init__(self, flight: FlightResult, solver: str = "sqp"):
        """Make the parts of a recorded flight's controller."""
        config, self._s = flight.config, flight.signals
        believed, period = config.controller.believed(config.vehicle), config.controller.period
        mpc = config.controller.mpc
        self._config, self._model = config, make_residual_model(config.controller, believed)
        self._labels = LabelFilter(
            labelled(believed, self._model), config.controller.label, step=period
        )
        self._mpc = MpcController(believed, mpc, make_solver(solver, believed, mpc), period=period)
        self._reference = config.motion
        self._ahead = mpc.step * np.arange(mpc.horizon + 1)
        self._kept, self._last = self._labels.initial_memory(), self._mpc.initial_memory()
        self._memory: Memory = {} if self._model is None else self._model.initial_memory()
        self.periods = len(self._s["t"])

    def predict(self, k: int) -> WrenchForecast | None:
        """Take in the reading of period k > 0 and return the forecast; None where nothing is
        learned.
        """
        if self._model is None:
            return None
        x, acceleration, u = self._s["x"][k], self._s["acceleration"][k], self._s["u"][k - 1]
        self._kept, chi = self._labels.step(
            self._kept, x=x, a=acceleration[:3], al=acceleration[3:], u=u
        )
        self._memory = self._model.update(self._memory, Sample(x, u, chi))
        span = {
            "horizon": self._config.controller.mpc.horizon,
            "stride": self._config.controller.stride,
        }
        return self._model.forecast(self._memory, **span)

    def solve(self, k: int, forecast: WrenchForecast | None) -> float:
        """Compute the plan of period k and return the status of its solver.

        Args:
            forecast: of `predict`.
        """
        flat = self._reference.sample(self._s["t"][k] + self._ahead)
        self._last = self._mpc.step(self._last, x=self._s["x"][k], flat=flat, forecast=forecast)
        return float(self._last.flags[0])


def replayed(
    loop: ControlLoop,
    first: int,
    clock: Callable[[], float],
    *,
    before: Callable[[int], None] = lambda k: None,
    after: Callable[[int], None] = lambda k: None,
) -> tuple[np.ndarray, np.ndarray]:
    """Replay the periods from `first` > 0 on.

    The readings are those of the flight, so that a command of the replay has no effect on what
    comes after.

    Args:
        clock: that measures [s].
        before: called with the number of each period that begins; not measured.
    Returns: when each began, had its forecast and had its plan, (n, 3) [s], and the status of its
        solver (n,).
    """
    times, status = np.zeros((loop.periods, 3)), np.zeros(loop.periods)
    for k in range(first, loop.periods):
        before(k)
        begin = clock()
        forecast = loop.predict(k)
        middle = clock()
        status[k] = loop.solve(k, forecast)
        times[k] = begin, middle, clock()
        after(k)
    return times[first:], status[first:]
