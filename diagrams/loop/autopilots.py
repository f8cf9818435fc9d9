"""Autopilots between the controller and the rotors, by name."""

import dataclasses as dc

from pydrake.systems.framework import Diagram, DiagramBuilder, LeafSystem, OutputPort

from diagrams.loop.reality import RealityConfig
from np_drake.autopilot.betaflight import Betaflight, BetaflightConfig
from np_drake.effects.command_delay import CommandDelay
from np_drake.effects.motor_lag import MotorLag
from np_drake.vehicle import Vehicle
from systems.betaflight import BetaflightAutopilot
from systems.rate_loop import RateLoopAutopilot

NONE = "none"  # the rotors take thrust and torque at once
AUTOPILOTS = (NONE, "rate_loop", "betaflight")
AUTOPILOT = "autopilot"  # its name as a subsystem of a flight


@dc.dataclass
class AutopilotConfig:
    """What stands between the controller and the rotors."""

    kind: str = NONE  # none | rate_loop: as the vehicle file says | betaflight: its firmware
    betaflight: BetaflightConfig = dc.field(default_factory=BetaflightConfig)

    def check(self) -> "AutopilotConfig":
        """Return self after checking all values.

        Raises: ValueError: where one is impossible.
        """
        if self.kind not in AUTOPILOTS:
            raise ValueError(
                f"autopilot: must be one of {', '.join(AUTOPILOTS)}; got {self.kind!r}."
            )
        self.betaflight.check()
        return self

    @property
    def flies(self) -> bool:
        """Whether there is an autopilot, which follows body rates."""
        return self.kind != NONE


def add_autopilot(
    builder: DiagramBuilder,
    config: AutopilotConfig,
    vehicle: Vehicle,
    real: Diagram,
    rates_thrust: OutputPort,
) -> LeafSystem:
    """Add the autopilot of a flight, and return it; its port `u` drives the rotors.

    Args:
        real: the vehicle that flies, whose true motion the autopilot's sensors see.
    Raises: ValueError: where the firmware is missing or refuses its settings.
    """
    system: LeafSystem
    if config.kind == "rate_loop":
        system = RateLoopAutopilot(vehicle)
    else:
        system = BetaflightAutopilot(vehicle, Betaflight(vehicle, config.betaflight))
    builder.AddNamedSystem(AUTOPILOT, system)
    if system.HasInputPort("acceleration"):
        builder.Connect(real.GetOutputPort("acceleration"), system.GetInputPort("acceleration"))
    builder.Connect(real.GetOutputPort("x"), system.GetInputPort("x"))
    builder.Connect(rates_thrust, system.GetInputPort("rates_thrust"))
    return system


def as_flown(
    config: AutopilotConfig, vehicle: Vehicle, reality: RealityConfig
) -> tuple[Vehicle, RealityConfig]:
    """Return the vehicle and what acts on it behind an autopilot; lag and delay of the rotors are
    within a rate loop.
    """
    if config.kind != "rate_loop":
        return vehicle, reality
    late = (MotorLag, CommandDelay)
    effects = [entry for entry in reality.effects if not isinstance(entry.made, late)]
    at_once = dc.replace(reality, motor_lag=0.0, command_delay=0.0, effects=effects)
    return dc.replace(vehicle, rotor_time_constant=0.0), at_once


def firmware_of(diagram: Diagram) -> Betaflight | None:
    """Return the firmware of a flight, None where it has none.

    Args:
        diagram: of `make_flight_diagram`.
    """
    if not diagram.HasSubsystemNamed(AUTOPILOT):
        return None
    return getattr(diagram.GetSubsystemByName(AUTOPILOT), "firmware", None)
