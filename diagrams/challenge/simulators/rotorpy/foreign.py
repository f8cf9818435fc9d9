"""The vehicle of rotorpy's in this project's own closed loop."""

import dataclasses as dc
from collections.abc import Sequence

import numpy as np
from pydrake.systems.framework import Context, Diagram

from diagrams.challenge.simulators.rotorpy.library_effects import ActiveEffect
from diagrams.challenge.simulators.rotorpy.rotorpy_vehicle import RotorPyVehicle, make_rotorpy_vehicle
from diagrams.challenge.simulators.rotorpy.simulator import read_effects
from diagrams.loop.reality import RealityConfig
from np_drake.vehicle import Vehicle
from systems.payload_event import PayloadEvent


@dc.dataclass(frozen=True)
class ForeignVehicle:
    """The `RealVehicle` that rotorpy flies, with the effects of the reality as they are written for rotorpy.

    The sensors are those of the loop, and Drake integrates. A gusty wind has the same statistics as in Drake, but other
    gusts.   own: whether rotorpy's own drag, lift and motor lag act beside the effects (`own_physics`).
    """

    own: bool = False

    def make(
        self,
        vehicle: Vehicle,
        reality: RealityConfig,
        *,
        command_period: float,
        pushed: bool = False,
        events: Sequence[PayloadEvent] = (),
    ) -> Diagram:
        """Return the vehicle.

        Raises: ValueError: on what rotorpy does not know (`foreign_effects`), events or pushes.
        """
        if events:
            raise ValueError("rotorpy: events must be none for this simulator; fly Drake's vehicle.")
        if pushed:
            raise ValueError(
                "rotorpy: there must be no pushes from outside; watch a flight of Drake's vehicle."
            )
        effects = foreign_effects(reality)
        return make_rotorpy_vehicle(vehicle, effects, command_period=command_period, own=self.own)

    def hover(self, system: Diagram, root: Context, reality: RealityConfig, p_WB: np.ndarray) -> None:
        """Set the vehicle level and at rest at p_WB (3,) [m], with the payload hanging still."""
        rotorpy = system.GetSubsystemByName("rotorpy")
        assert isinstance(rotorpy, RotorPyVehicle)
        rotorpy.set_hover(rotorpy.GetMyMutableContextFromRoot(root), p_WB)


def foreign_effects(reality: RealityConfig) -> list[ActiveEffect]:
    """Return the effects of a reality as rotorpy reads them, without those of sensors.

    Raises: ValueError: on an effect that is unknown there or begins in flight, a disturbance, a rod, or lags in series.
    """
    if reality.disturbance.acts:
        raise ValueError("rotorpy: disturbance must be none; it is what a model leaves over, and no effect.")
    if reality.onsets:
        late = ", ".join(effect.identifier for effect in reality.onsets)
        raise ValueError(f"rotorpy: effects must act from the start; {late} begins in flight.")
    if reality.hung.tether == "rod":
        raise ValueError("rotorpy: tether must be cable or none; got rod.")
    if len(reality.lags) > 1:
        raise ValueError(f"rotorpy: there must be one motor lag at most; got {len(reality.lags)} in series.")
    hung = reality.hung.tether != "none"  # a payload without mass is none
    return read_effects(
        [
            effect
            for effect in reality.everything()
            if not hasattr(effect, "measure") and (hung or effect.identifier != "suspended_payload")
        ]
    )
