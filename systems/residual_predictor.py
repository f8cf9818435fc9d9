"""LeafSystem for any residual model, with its memory in the Context."""

import dataclasses as dc
from collections.abc import Callable

import numpy as np
from pydrake.common.value import Value
from pydrake.systems.framework import (
    BasicVector,
    CacheEntry,
    DiscreteStateIndex,
    LeafSystem,
    ValueProducer,
)

from np_drake.command_delay import KEPT
from np_drake.mpc.controller import shift
from np_drake.mpc.look_ahead import LookAhead
from np_drake.mpc.problem import MpcSolution, MpcStatus
from np_drake.residual_model import Memory, Plan, ReadsPlan, ResidualModel, Sample, WrenchForecast
from np_drake.vehicle import Vehicle


class MemorySystem(LeafSystem):
    """LeafSystem that keeps a pure algorithm's memory in the Context: one discrete group for each
    array.

    The step of the algorithm runs once per sampling instant: the feed-through output and the event
    that stores the new memory read the same cache entry.
    """

    def __init__(self) -> None:
        super().__init__()
        # index and shape by name
        self._groups: dict[str, tuple[DiscreteStateIndex, tuple[int, ...]]] = {}

    def _declare_memory(self, initial: Memory) -> None:
        """Declare a group for each array that has none yet, sorted by name."""
        for name in sorted(set(initial) - set(self._groups)):
            self._declare_group(name, initial)

    def _declare_group(self, name: str, initial: Memory) -> DiscreteStateIndex:
        """Declare the group of one array, row by row, and return its index in the Context.

        Args:
            name: of the array in the memory.
            initial: the memory before any sample.
        """
        index = self.DeclareDiscreteState(BasicVector(np.ravel(initial[name]).astype(float)))
        self._groups[name] = index, np.shape(initial[name])
        return index

    def _declare_step(self, calc: Callable) -> CacheEntry:
        """Declare the cache entry that holds `calc(context)`."""

        def store(context, value) -> None:
            value.set_value(calc(context))

        return self.DeclareCacheEntry(
            "step",
            ValueProducer(allocate=Value[object], calc=store),
            {self.all_input_ports_ticket(), self.xd_ticket()},
        )

    def memory(self, context) -> Memory:
        """Return the memory as of the last event."""
        state = context.get_discrete_state()
        return {
            name: state.value(index).reshape(shape).copy()
            for name, (index, shape) in self._groups.items()
        }

    def _store_memory(self, memory: Memory, discrete_state) -> None:
        for name, (index, _) in self._groups.items():
            discrete_state.set_value(index, np.ravel(memory[name]))


class PlanPorts:
    """Ports plan_u (4 N) and plan_x (13 (N+1)) of a LeafSystem.

    Args:
        system: that gets the ports.
        horizon: N.
        step: of the plan [s].
        age: of the plan when it is read [s].
    """

    def __init__(self, system, *, horizon: int, step: float, age: float):
        self._horizon = horizon
        self._step = step
        self._age = age
        self._u_port = system.DeclareVectorInputPort("plan_u", 4 * horizon)
        self._x_port = system.DeclareVectorInputPort("plan_x", 13 * (horizon + 1))

    def read(self, context) -> Plan:
        """Return the plan from now on, held beyond its end."""
        N = self._horizon
        u = self._u_port.Eval(context).reshape(N, 4)
        x = self._x_port.Eval(context).reshape(N + 1, 13)
        plan = MpcSolution(u, x, np.zeros((N, 6)), MpcStatus.OPTIMAL, 0.0, 0.0, 0.0, 0)
        plan = shift(plan, elapsed=self._age, step=self._step)
        return Plan(plan.x, plan.u)


class ResidualPredictor(MemorySystem):
    """Residual model in the loop, with one sample per step and its forecast over the MPC's horizon.

    .. pydrake_system::

        name: ResidualPredictor
        input_ports:
        - x
        - u
        - label
        - plan_u
        - plan_x
        - sent
        - delay
        output_ports:
        - forecast
        - chi_hat

    | port | size | meaning | unit |
    |---|---|---|---|
    | x | 13 | measured state | |
    | u | 4 | command that acted up to now | N, N·m |
    | label | 6 | wrench label now; NaN where there is none | N, N·m |
    | plan_u, plan_x | 4 N, 13 (N+1) | the MPC's last plan, one period old; where the model is a `ReadsPlan` | |
    | sent | 4 KEPT | commands, the newest first (`DelayEstimator`); where `vehicle` is given | N, N·m |
    | delay | 1 | after which the next command acts; where `vehicle` is given, unconnected: 0 | s |
    | forecast | WrenchForecast | from `delay` on, with the sample at hand taken in; feeds through | |
    | chi_hat | 6 | the forecast's first wrench, `delay` later, as of the last event | N, N·m |

    State: one discrete group for each array of the model's memory, sorted by name, then chi_hat
    (6).
    Event: periodic, every `model.step`.

    Args:
        horizon: N of the forecast.   stride: model steps in one step of the forecast.
        vehicle: nominal, predicts the motion until the next command acts; None: commands act at
            once.
    """  # noqa: E501

    def __init__(
        self, model: ResidualModel, *, horizon: int, stride: int, vehicle: Vehicle | None = None
    ):
        super().__init__()
        self._model = model
        self._span = {"horizon": horizon, "stride": stride}
        self._x_port = self.DeclareVectorInputPort("x", 13)
        self._u_port = self.DeclareVectorInputPort("u", 4)
        self._label_port = self.DeclareVectorInputPort("label", 6)
        self._reads_plan: tuple[ReadsPlan, PlanPorts] | None = None
        if isinstance(model, ReadsPlan):
            self._reads_plan = (
                model,
                PlanPorts(self, horizon=horizon, step=stride * model.step, age=model.step),
            )
        self._look_ahead = None if vehicle is None else LookAhead(model, vehicle)
        if self._look_ahead is not None:
            self._sent_port = self.DeclareVectorInputPort("sent", 4 * KEPT)
            self._delay_port = self.DeclareVectorInputPort("delay", 1)
        initial = model.initial_memory()
        self._declare_memory(initial)
        first = model.forecast(initial, **self._span).first
        self._chi_index = self.DeclareDiscreteState(BasicVector(first))
        self._step = self._declare_step(self._take_sample)
        self.DeclareAbstractOutputPort(
            "forecast", Value[object], self._calc_forecast, {self._step.ticket()}
        )
        self.DeclareStateOutputPort("chi_hat", self._chi_index)
        self.DeclarePeriodicDiscreteUpdateEvent(model.step, 0.0, self._update_memory)

    def _take_sample(self, context):
        sample = Sample(
            self._x_port.Eval(context), self._u_port.Eval(context), self._label_port.Eval(context)
        )
        memory = self._model.update(self.memory(context), sample)
        if self._look_ahead is None or not self._delay_port.HasValue(context):
            return memory, self._forecast(context, memory)
        delay = self._delay_port.Eval(context)[0]
        if delay == 0.0 or not np.all(np.isfinite(sample.x)):
            return memory, self._forecast(context, memory)
        sent = self._sent_port.Eval(context).reshape(KEPT, 4)
        later, start = self._look_ahead(memory, sample.x, sent, delay)
        return memory, dc.replace(self._forecast(context, later), start=start)

    def _forecast(self, context, memory: Memory) -> WrenchForecast:
        if self._reads_plan is None:
            return self._model.forecast(memory, **self._span)
        model, plan = self._reads_plan
        return model.forecast_along(memory, plan.read(context), **self._span)

    def _calc_forecast(self, context, output) -> None:
        output.set_value(self._step.Eval(context)[1])

    def _update_memory(self, context, discrete_state) -> None:
        memory, forecast = self._step.Eval(context)
        self._store_memory(memory, discrete_state)
        discrete_state.set_value(self._chi_index, np.asarray(forecast.first))
