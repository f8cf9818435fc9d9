"""Adds an effect, flies with it in Drake, and finds it again in the flight logs.

Shows: one frozen dataclass serves the simulator and the diagnosis. `register` puts it into the list
of effects that the diagnosis tries and a scenario may name.
"""

import dataclasses as dc

import numpy as np

from diagrams.loop.flight import FlightConfig
from diagrams.loop.flight_result import fly
from diagrams.loop.reality import RealityConfig
from np_drake.diagnosis.diagnose import diagnose
from np_drake.effects.base import Parameter, WrenchEffect
from np_drake.effects.effect_entry import EffectEntry
from np_drake.effects.library import register
from np_drake.flight_log import FlightLog
from np_drake.references.config import ReferenceConfig
from systems.payload_config import PayloadConfig


@register
@dc.dataclass(frozen=True)
class GroundSpring(WrenchEffect):
    """An elastic cord to the origin of W: F = -stiffness p_WB."""

    stiffness: float = 0.5  # [N/m]

    parameters = (Parameter("stiffness", "N/m", neutral=0.0, lower=0.0, upper=5.0, typical=0.5),)

    def wrench(self, vehicle, motion):
        force = -self.stiffness * motion.x[..., 0:3]
        return np.concatenate([force, np.zeros_like(force)], axis=-1)


def main() -> None:
    """Flies a circle and a lemniscate with the cord, diagnoses them, prints the verdict and the
    stiffness.
    """
    cord = EffectEntry.of(GroundSpring(0.5))
    nothing = PayloadConfig(tether="none")
    reality = RealityConfig(
        nothing, rotor_drag=0.0, motor_lag=0.0, thrust_scale=1.0, effects=[cord]
    )
    logs: list[FlightLog] = []
    for track, speed in (("circle", 1.5), ("lemniscate", 2.0)):
        reference = ReferenceConfig(track, speed=speed, ramp=3.0, dither=[0.08, 0.08, 0.08])
        config = FlightConfig(name=track, duration=7.0, reality=reality, reference=reference)
        config.controller.solver = "sqp"
        logs.append(fly(config, seed=len(logs)).log())
    # a simulator logs commands as they act
    vehicle = dc.replace(config.vehicle, command_timing="held")
    diagnosis = diagnose(logs[:1], logs[1:], vehicle)
    print(diagnosis.verdict, diagnosis.causes[0].parameters["stiffness"])


if __name__ == "__main__":
    main()
