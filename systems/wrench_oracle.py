"""True wrench over the last plan, as a forecast; for tests and tables only."""

import numpy as np
from pydrake.common.value import Value
from pydrake.systems.framework import LeafSystem

from np_drake import attitude
from np_drake.mpc.problem import MpcConfig
from np_drake.residual_models.base import constant_forecast
from np_drake.residual_models.oracle import TrueModel
from systems.plan_ports import PlanPorts


class WrenchOracle(LeafSystem):
    """Forecast of the true model along the plan of the last period.

    .. pydrake_system::

        name: WrenchOracle
        input_ports:
        - plant_state
        - rotor_thrust
        - plan_u
        - plan_x
        output_ports:
        - forecast

    | port | size | meaning | unit |
    |---|---|---|---|
    | plant_state | 26 or 13 | the plant's true state, with a cable or without a payload | |
    | rotor_thrust | 4 | actual rotor thrust | N |
    | plan_u, plan_x | 4 N, 13 (N+1) | the MPC's last plan, one period old | |
    | forecast | WrenchForecast | the true chi along it | |

    No state. Args: period: age of the plan [s].
    """

    def __init__(self, model: TrueModel, config: MpcConfig, *, period: float):
        super().__init__()
        self._model, self._config = model, config
        size = 13 if model.payload is None else 26
        self._state_port = self.DeclareVectorInputPort("plant_state", size)
        self._thrust_port = self.DeclareVectorInputPort("rotor_thrust", 4)
        self._plan = PlanPorts(self, horizon=config.horizon, step=config.step, age=period)
        self.DeclareAbstractOutputPort(
            "forecast",
            Value[object],
            self._calc_forecast,
            {self.all_input_ports_ticket(), self.time_ticket()},
        )

    def _calc_forecast(self, context, output) -> None:
        plan = self._plan.read(context)
        chi = self._model.wrench_along(
            plan.x,
            plan.u,
            self._config.step,
            t=context.get_time(),
            rotor_thrust=self._thrust_port.Eval(context),
            swing_state=self._swing_state(self._state_port.Eval(context)),
        )
        output.set_value(constant_forecast(chi, self._config.horizon))

    def _swing_state(self, s: np.ndarray) -> tuple[np.ndarray, np.ndarray] | None:
        """Return (p_ToPo_W, its rate) from Drake's state of two free bodies."""
        if self._model.payload is None:
            return None
        hook = attitude.rotate(s[0:4], np.array(self._model.payload.hook))
        r = s[11:14] - s[4:7] - hook
        return r, s[23:26] - s[17:20] - np.cross(s[14:17], hook)
