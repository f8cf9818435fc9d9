"""The vehicle that flies in the loop: Drake's plant, or that of another simulator."""

from collections.abc import Sequence
from typing import Protocol

import numpy as np
from pydrake.systems.framework import Context, Diagram

from diagrams.loop.reality import RealityConfig
from np_drake.effects.calibration import in_flight
from np_drake.effects.combine import split_effects
from np_drake.vehicle import Vehicle
from systems.payload_config import PayloadEvent
from systems.plant import set_hover
from systems.tethered_quadrotor import make_tethered_quadrotor

REAL_VEHICLE = "tethered_quadrotor"  # its name as a subsystem of a flight


class RealVehicle(Protocol):
    """Maker of the vehicle that flies, with the effects of a reality."""

    def make(
        self,
        vehicle: Vehicle,
        reality: RealityConfig,
        *,
        command_period: float,
        pushed: bool = False,
        events: Sequence[PayloadEvent] = (),
    ) -> Diagram:
        """Return the vehicle with the ports of `make_tethered_quadrotor`; `tether_wrench` may be
        missing.

        Args:
            command_period: at whose multiples alone the command changes [s].
        Raises: ValueError: on what the simulator does not know.
        """

    def hover(
        self, system: Diagram, root: Context, reality: RealityConfig, p_WB: np.ndarray
    ) -> None:
        """Set the made vehicle level and at rest, with the payload hanging still.

        Args:
            system: that `make` returned.
            reality: of `make`.
            p_WB: (3,) in W [m].
        """


class DrakeVehicle(RealVehicle):
    """The `RealVehicle` of the project's own simulator."""

    def make(
        self,
        vehicle: Vehicle,
        reality: RealityConfig,
        *,
        command_period: float = 0.001,
        pushed: bool = False,
        events: Sequence[PayloadEvent] = (),
    ) -> Diagram:
        """Return the plant with the calibration of its file and the effects that `reality` switches
        on.

        Args:
            command_period: at whose multiples alone the command changes [s].
        """
        own = split_effects(in_flight(vehicle, beside=reality.actuator_effects()))
        return make_tethered_quadrotor(
            vehicle,
            reality.hung,
            wrench_effects=[*own.wrench, *reality.wrench_effects()],
            actuator_effects=[*reality.actuator_effects(), *own.actuator],
            mass_effects=[*own.mass, *reality.mass_effects()],
            command_period=command_period,
            onsets=reality.onsets,
            hangs_at=reality.hangs_at,
            events=events,
            pushed=pushed,
        )

    def hover(
        self, system: Diagram, root: Context, reality: RealityConfig, p_WB: np.ndarray
    ) -> None:
        """Set the vehicle level and at rest, with the payload at its static stretch.

        Args:
            system: that `make` returned.
            reality: of `make`.
            p_WB: (3,) in W [m].
        """
        plant = system.GetSubsystemByName("plant")
        set_hover(plant, plant.GetMyMutableContextFromRoot(root), reality.hung, p_WB)


DRAKE = DrakeVehicle()
make_real_vehicle = DRAKE.make
