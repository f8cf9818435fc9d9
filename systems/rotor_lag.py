"""First-order lag of rotor speed, which Drake integrates without a call of Python."""

import numpy as np
from pydrake.systems.framework import Context, DiagramBuilder, OutputPort
from pydrake.systems.primitives import Adder, Gain, Integrator

from np_drake.effects.motor_lag import MotorLag
from np_drake.vehicle import Vehicle


class RotorSpeed(Integrator):
    """Integral of the rotors' acceleration.

    .. pydrake_system::

        name: RotorSpeed
        input_ports:
        - u
        output_ports:
        - y

    | port | size | meaning | unit |
    |---|---|---|---|
    | u | 4 | acceleration | rad/s² |
    | y | 4 | rotor speed | rad/s |

    Continuous state: rotor speed; it starts at rest under hover thrust.

    Args:
        vehicle: nominal.
        hover_thrust: (4,) [N].
    """

    def __init__(self, vehicle: Vehicle, hover_thrust: np.ndarray):
        super().__init__(MotorLag().state_at(vehicle, hover_thrust))
        self._vehicle = vehicle

    def rest_at(self, context: Context, thrust: np.ndarray) -> None:
        """Set the speed at which a constant command rests.

        Args:
            context: the system's own.
            thrust: (4,) command [N].
        """
        context.SetContinuousState(MotorLag().state_at(self._vehicle, thrust))


def add_rotor_lag(
    builder: DiagramBuilder,
    vehicle: Vehicle,
    lag: MotorLag,
    target: OutputPort,
    *,
    hover_thrust: np.ndarray,
) -> OutputPort:
    """Add rotors that follow their commanded speed, T d omega/dt = omega_command - omega, and
    return their speed.

    Args:
        builder: of the diagram.
        vehicle: nominal.
        lag: gives the time constant T.
        target: port of the commanded speed over T (4,) [rad/s²].
        hover_thrust: (4,) at which the rotors start [N].
    """
    rotors = builder.AddNamedSystem("actuators", RotorSpeed(vehicle, hover_thrust))
    decay = builder.AddNamedSystem("rotor_decay", Gain(-1.0 / lag.time_constant, 4))
    rate = builder.AddNamedSystem("rotor_rate", Adder(2, 4))
    builder.Connect(rotors.get_output_port(), decay.get_input_port())
    builder.Connect(target, rate.get_input_port(0))
    builder.Connect(decay.get_output_port(), rate.get_input_port(1))
    builder.Connect(rate.get_output_port(), rotors.get_input_port())
    return rotors.get_output_port()
