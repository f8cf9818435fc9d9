"""Measurement wrapper: effects between the true motion and the sensors' reading."""

from collections.abc import Sequence

import numpy as np
from pydrake.common.value import Value
from pydrake.systems.framework import LeafSystem, ValueProducer

from np_drake.effects.base import Measurement, MeasurementEffect
from np_drake.vehicle import Vehicle


class MeasurementEffects(LeafSystem):
    """Chain of measurement effects through which the true motion passes.

    .. pydrake_system::

        name: MeasurementEffects
        input_ports:
        - x_true
        - acceleration_true
        - nominal_rotor_thrust
        - white
        output_ports:
        - x
        - acceleration
        - rotor_speed

    | port | size | meaning | unit |
    |---|---|---|---|
    | x_true, x | 13 | state, true and as read | |
    | acceleration_true, acceleration | 6 | [a in W, al in B] | m/s², rad/s² |
    | nominal_rotor_thrust | 4 | thrust coefficient times the square of the actual rotor speed | N |
    | white | sum of white_size | standard normal draws, held between samples | 1 |
    | rotor_speed | 4 | as read | rad/s |

    Raises: ValueError: on an effect that shifts the clock, which no causal sensor can do.
    """

    def __init__(self, vehicle: Vehicle, effects: Sequence[MeasurementEffect]):
        super().__init__()
        shifted = [e.identifier for e in effects if getattr(e, "clock_shift", 0.0) != 0.0]
        if shifted:
            raise ValueError(
                f"MeasurementEffects: a reading must not look into the future; got {', '.join(shifted)}. "
                "Shift the recorded log instead (np_drake.logs.clock.shift_state)."
            )
        self._vehicle, self._effects = vehicle, list(effects)
        self.white_size = sum(e.white_size for e in effects)
        self._x_port = self.DeclareVectorInputPort("x_true", 13)
        self._acceleration_port = self.DeclareVectorInputPort("acceleration_true", 6)
        self._thrust_port = self.DeclareVectorInputPort("nominal_rotor_thrust", 4)
        self._white_port = self.DeclareVectorInputPort("white", self.white_size)
        inputs = {self.all_input_ports_ticket()}
        # Acceleration and rotor speed of one instant are of the same pass through the effects.
        self._reading = self.DeclareCacheEntry(
            "reading", ValueProducer(allocate=Value[object], calc=self._calc_reading), inputs
        )
        # x alone must not pull accelerations: they feed through from the forces.
        state_inputs = {self._x_port.ticket(), self._white_port.ticket()}
        self.DeclareVectorOutputPort("x", 13, self._calc_x, state_inputs)
        self.DeclareVectorOutputPort("acceleration", 6, self._calc_acceleration, inputs)
        self.DeclareVectorOutputPort("rotor_speed", 4, self._calc_rotor_speed, inputs)

    def _measure(self, context, rest: np.ndarray, thrust: np.ndarray) -> Measurement:
        rotor = np.sqrt(np.maximum(thrust, 0.0) / self._vehicle.thrust_coefficient)
        reading = Measurement(self._x_port.Eval(context), rest[:3], rest[3:], rotor)
        white, start = self._white_port.Eval(context), 0
        for effect in self._effects:
            reading = effect.measure(self._vehicle, reading, white[start : start + effect.white_size])
            start += effect.white_size
        return reading

    def _calc_reading(self, context, value) -> None:
        value.set_value(
            self._measure(context, self._acceleration_port.Eval(context), self._thrust_port.Eval(context))
        )

    def _calc_x(self, context, output) -> None:
        output.SetFromVector(self._measure(context, np.zeros(6), np.zeros(4)).x)

    def _calc_acceleration(self, context, output) -> None:
        reading = self._reading.Eval(context)
        output.SetFromVector(np.concatenate([reading.a, reading.al]))

    def _calc_rotor_speed(self, context, output) -> None:
        output.SetFromVector(self._reading.Eval(context).rotor)
