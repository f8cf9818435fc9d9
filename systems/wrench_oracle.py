"""True wrench over the last plan, as a forecast; for tests and tables only."""

import dataclasses as dc

import numpy as np
from pydrake.common.value import Value
from pydrake.systems.framework import LeafSystem

from np_drake import attitude
from np_drake.command_delay import FINE, KEPT, commands_under_way
from np_drake.mpc.dynamics import DiscreteDynamics
from np_drake.mpc.problem import MpcConfig
from np_drake.residual_model import Plan, WrenchForecast, constant_forecast
from np_drake.residual_models.oracle import TrueModel
from np_drake.rigid_body import Q
from systems.residual_predictor import PlanPorts


class WrenchOracle(LeafSystem):
    """Forecast of the true model along the plan of the last period.

    .. pydrake_system::

        name: WrenchOracle
        input_ports:
        - plant_state
        - rotor_thrust
        - plan_u
        - plan_x
        - x
        - sent
        - delay
        output_ports:
        - forecast

    | port | size | meaning | unit |
    |---|---|---|---|
    | plant_state | 26 or 13 | the plant's true state, with a cable or without a payload | |
    | rotor_thrust | 4 | actual rotor thrust | N |
    | plan_u, plan_x | 4 N, 13 (N+1) | the MPC's last plan, one period old | |
    | x | 13 | state at which the motion begins; read where there is a delay | |
    | sent | 4 KEPT | commands, the newest first; read where there is a delay | N, N·m |
    | delay | 1 | after which the next command acts; unconnected: 0 | s |
    | forecast | WrenchForecast | the true chi along the plan, from `delay` on | |

    No state.

    Args:
        model: gives the wrench.
        config: horizon of the plan.
        period: age of the plan [s].
    """

    def __init__(self, model: TrueModel, config: MpcConfig, *, period: float):
        super().__init__()
        self._model = model
        self._config = config
        self._fine = period / FINE
        self._dynamics = DiscreteDynamics(model.believed, self._fine)
        size = 13 if model.payload is None else 26
        self._state_port = self.DeclareVectorInputPort("plant_state", size)
        self._thrust_port = self.DeclareVectorInputPort("rotor_thrust", 4)
        self._plan = PlanPorts(self, horizon=config.horizon, step=config.step, age=period)
        self._x_port = self.DeclareVectorInputPort("x", 13)
        self._sent_port = self.DeclareVectorInputPort("sent", 4 * KEPT)
        self._delay_port = self.DeclareVectorInputPort("delay", 1)
        self.DeclareAbstractOutputPort(
            "forecast",
            Value[object],
            self._calc_forecast,
            {self.all_input_ports_ticket(), self.time_ticket()},
        )

    def _calc_forecast(self, context, output) -> None:
        plan = self._plan.read(context)
        delay = self._delay_port.Eval(context)[0] if self._delay_port.HasValue(context) else 0.0
        output.set_value(
            self._now(context, plan) if delay == 0.0 else self._later(context, plan, delay)
        )

    def _now(self, context, plan: Plan) -> WrenchForecast:
        chi = self._wrench(context, plan.x, plan.u, self._config.step)
        return constant_forecast(chi, self._config.horizon)

    def _later(self, context, plan: Plan, delay: float) -> WrenchForecast:
        """Return the forecast along the commands that are on their way, and then along the plan."""
        sent = self._sent_port.Eval(context).reshape(KEPT, 4)
        under_way = commands_under_way(sent, round(delay / self._fine))
        x = self._x_port.Eval(context)
        chi = self._wrench(context, np.stack([x, x]), under_way[:1], self._fine)
        path = self._path(x, under_way, np.repeat(chi, len(under_way), axis=0))
        path = self._path(x, under_way, self._wrench(context, path, under_way, self._fine))
        parts = round(self._config.step / self._fine)
        coming = _finer(plan.x, parts)
        chi = self._wrench(
            context,
            np.vstack([path[:-1], coming]),
            np.vstack([under_way, np.repeat(plan.u, parts, axis=0)]),
            self._fine,
        )[len(under_way) :]
        mean = chi.reshape(self._config.horizon, parts, 6).mean(axis=1)
        return dc.replace(constant_forecast(mean, self._config.horizon), start=path[-1])

    def _path(self, x: np.ndarray, u: np.ndarray, chi: np.ndarray) -> np.ndarray:
        """Return the states (n+1, 13) under commands and wrenches of n fine steps."""
        path = [x]
        for command, wrench in zip(u, chi, strict=True):
            path.append(self._dynamics.advance(path[-1], command, wrench))
        states = np.array(path)
        states[:, Q] = attitude.normalised(states[:, Q])
        return states

    def _wrench(self, context, x: np.ndarray, u: np.ndarray, step: float) -> np.ndarray:
        """Return the true chi along states and commands that begin now."""
        return self._model.wrench_along(
            x,
            u,
            step,
            t=context.get_time(),
            rotor_thrust=self._thrust_port.Eval(context),
            swing_state=self._swing_state(self._state_port.Eval(context)),
        )

    def _swing_state(self, s: np.ndarray) -> tuple[np.ndarray, np.ndarray] | None:
        """Return (p_ToPo_W, its rate) from Drake's state of two free bodies."""
        if self._model.payload is None:
            return None
        hook = attitude.rotate(s[0:4], np.array(self._model.payload.hook))
        r = s[11:14] - s[4:7] - hook
        return r, s[23:26] - s[17:20] - np.cross(s[14:17], hook)


def _finer(x: np.ndarray, parts: int) -> np.ndarray:
    """Return states (N+1, 13) with `parts` steps in each of theirs, interpolated, (parts N + 1,
    13).
    """
    share = (np.arange(parts) / parts)[:, None]
    between = (1 - share) * x[:-1, None] + share * x[1:, None]
    states = np.vstack([between.reshape(-1, 13), x[-1:]])
    states[:, Q] = attitude.normalised(states[:, Q])
    return states
