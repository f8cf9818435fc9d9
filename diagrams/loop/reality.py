"""The vehicle that flies: what acts on it and its sensors beyond the model that the controller
assumes.
"""

import dataclasses as dc
from collections.abc import Sequence

import numpy as np
from pydrake.systems.framework import Diagram

from diagrams.batch.run import require
from np_drake import effects as library
from np_drake.effects.base import (
    ActuatorEffect,
    Effect,
    MassEffect,
    MeasurementEffect,
    WrenchEffect,
)
from np_drake.effects.calibration import in_flight
from np_drake.effects.combine import EffectsByPlace, acting, require_complete, split_effects
from np_drake.effects.disturbance import Disturbance, DisturbanceConfig
from np_drake.effects.effect_entry import EffectEntry, Posterior
from np_drake.effects.motor_lag import MotorLag, at_once
from np_drake.files.yaml_file import POSITIVE, check_fields, number
from np_drake.vehicle.vehicle import MeasurementNoise, Vehicle
from systems.payload_config import PayloadConfig, PayloadEvent, as_light, payload_config
from systems.tethered_quadrotor import make_tethered_quadrotor

REAL_VEHICLE = "tethered_quadrotor"  # its name as a subsystem of a flight


@dc.dataclass
class RealityConfig:
    """Differences of the real vehicle from the one that the controller assumes."""

    payload: PayloadConfig = dc.field(default_factory=PayloadConfig)
    rotor_drag: float = number(0.25, "N·s/m", 0)  # on each body axis; 0 for none
    motor_lag: float = number(0.03, "s", 0)  # time constant of the rotor speed; 0 for none
    command_delay: float = number(0.0, "s", 0)  # from a command to the rotors, beyond their lag
    thrust_scale: float = number(0.96, "1", POSITIVE)  # real over nominal thrust at the start
    # share of the starting thrust that a falling battery takes each second
    thrust_loss: float = number(0.0, "1/s", 0)
    noise: MeasurementNoise = dc.field(default_factory=lambda: MeasurementNoise(attitude=0.003))
    wind: list[float] = number([0.0, 0.0, 0.0], "m/s")  # mean, in W; the drag feels it
    # standard deviation of each axis of the wind, correlated over 1 s
    gust: float = number(0.0, "m/s", 0)
    gust_seed: int = 0  # of the wind's gusts
    # Act besides all of these, each from its onset on; a suspended payload here needs `payload:
    # {tether: none}`.
    effects: list[EffectEntry] = dc.field(default_factory=list)
    # random, none unless named
    disturbance: DisturbanceConfig = dc.field(default_factory=DisturbanceConfig)
    # joint, of the parameters of `effects`
    posterior: Posterior = dc.field(default_factory=Posterior)

    def __post_init__(self) -> None:
        """Raises: ValueError: where a number is outside its bounds."""
        check_fields(self, "RealityConfig")

    def check(self) -> "RealityConfig":
        """Return self after checking all values.

        Raises: ValueError: on an impossible effect.
        """
        self.payload.check()
        check_fields(self.noise, "MeasurementNoise")
        check_fields(self, "RealityConfig")
        require(
            self.rotor_drag > 0
            or not self.blows
            or any(entry.effect in library.GustyWind.needs for entry in self.effects),
            "RealityConfig: wind acts through rotor_drag, which must then be positive, or through "
            "a drag among the effects.",
        )
        for entry in self.effects:
            entry.check()
        require_complete(self.added)
        self.disturbance.check()
        self.posterior.check()
        require(
            self._payload_effect is None or self.payload.tether == "none",
            "RealityConfig: there must be one payload; got `payload` and the effect "
            "suspended_payload. Write payload: {tether: none} beside the effect.",
        )
        return self

    @property
    def _payload_effect(self) -> library.SuspendedPayload | None:
        return split_effects(self.added).payload

    def nominal(self) -> "RealityConfig":
        """Return the vehicle as its file says, with the same noise of the sensors: the nominal
        simulator.
        """
        return RealityConfig(
            payload=PayloadConfig(tether="none"),
            rotor_drag=0.0,
            motor_lag=0.0,
            thrust_scale=1.0,
            noise=self.noise,
        )

    @property
    def added(self) -> list[Effect]:
        """The effects of `effects`."""
        return [entry.made for entry in self.effects]

    @property
    def onsets(self) -> dict[Effect, float]:
        """When those of `effects` begin that do not act from the start [s]."""
        return {entry.made: entry.onset for entry in self.effects if entry.onset}

    @property
    def hangs_at(self) -> float:
        """When the payload is hung; 0 from the start [s]."""
        effect = self._payload_effect
        return 0.0 if effect is None else self.onsets.get(effect, 0.0)

    @property
    def dead_time(self) -> float:
        """Time from a command to its effect on the rotors, beyond their lag [s]."""
        return sum(effect.dead_time for effect in self.actuator_effects())

    @property
    def lags(self) -> list[float]:
        """Time constants of the motors [s]."""
        return [e.time_constant for e in self.actuator_effects() if hasattr(e, "time_constant")]

    @property
    def hung(self) -> PayloadConfig:
        """The payload: `payload`, or the effect suspended_payload as a body."""
        effect = self._payload_effect
        return self.payload if effect is None else as_light(payload_config(effect))

    @property
    def blows(self) -> bool:
        """Whether there is any wind."""
        return any(self.wind) or self.gust > 0

    def wrench_effects(self) -> list[WrenchEffect]:
        """Return the effects that add a wrench to the body, or move the air."""
        d = self.rotor_drag
        effects: list[WrenchEffect] = [library.LinearDrag(d, d, d)] if d > 0 else []
        if self.blows:
            x, y, z = self.wind
            effects.append(library.GustyWind(x, y, z, deviation=self.gust, seed=self.gust_seed))
        effects += split_effects(self.added).wrench
        gusts = [Disturbance(self.disturbance)] if self.disturbance.acts else []
        return [*effects, *gusts]

    def actuator_effects(self) -> list[ActuatorEffect]:
        """Return the effects between command and thrust, in the order of action."""
        effects: list[ActuatorEffect] = (
            [library.CommandDelay(self.command_delay)] if self.command_delay > 0 else []
        )
        effects += [MotorLag(self.motor_lag)] if self.motor_lag > 0 else []
        effects += [library.ThrustScale(self.thrust_scale)] if self.thrust_scale != 1.0 else []
        effects += [library.ThrustDrift(1.0, -self.thrust_loss)] if self.thrust_loss > 0 else []
        return effects + [e for e in split_effects(self.added).actuator if not at_once(e)]

    def mass_effects(self) -> list[MassEffect]:
        """Return the effects on the mass properties."""
        return split_effects(self.added).mass

    def sensor_effects(self) -> list[MeasurementEffect]:
        """Return what the sensors do, noise last; a shifted clock is left out (`clock_shift`)."""
        effects = [
            e for e in split_effects(self.added).measurement if not getattr(e, "clock_shift", 0.0)
        ]
        return [*effects, library.SensorNoise(self.noise)]

    @property
    def clock_shift(self) -> float:
        """Time by which state rows of the log run ahead of the commands [s]."""
        return sum(getattr(e, "clock_shift", 0.0) for e in split_effects(self.added).measurement)

    def everything(self) -> list[Effect | MeasurementEffect]:
        """Return all effects, a payload among them; the noise of sensors is none."""
        payload = self._payload_effect
        hung = self.hung
        if payload is None and hung.tether != "none":
            x, y, z = hung.hook
            payload = library.SuspendedPayload(*hung.pendulum, x, y, z, hung.air_damping)
        effects: list[Effect | MeasurementEffect] = [*self.mass_effects(), *self.actuator_effects()]
        if hung.rope_mass:
            effects.append(library.MassError(hung.mass + hung.rope_mass - hung.pendulum[0]))
        effects += [*self.wrench_effects(), *([payload] if payload else [])]
        return [*effects, *split_effects(self.added).measurement]

    def with_calibration(self, vehicle: Vehicle) -> EffectsByPlace:
        """Return what acts on wrench, thrust and mass of a vehicle, its calibration included."""
        actuators = self.actuator_effects()
        calibration = in_flight(vehicle, others=actuators)
        return split_effects(
            [*actuators, *calibration, *self.wrench_effects(), *self.mass_effects()]
        )

    def thrust_at(self, vehicle: Vehicle, t: float, *, failing: bool = True) -> float:
        """Return real over nominal thrust, mean of the rotors [1].

        Args:
            t: time since the start [s].
        """
        thrust = np.ones(4)
        for effect in acting(self.actuator_effects(), self.onsets, t if failing else 0.0):
            thrust = effect.thrust(vehicle, effect.state_at(vehicle, thrust), thrust, t)
        return float(thrust.mean())


def make_real_vehicle(
    vehicle: Vehicle,
    reality: RealityConfig,
    *,
    command_period: float = 0.001,
    events: Sequence[PayloadEvent] = (),
) -> Diagram:
    """Return the vehicle that flies, with the ports of `make_tethered_quadrotor`.

    It has the calibration of its file and the effects that `reality` switches on.

    Args:
        command_period: at whose multiples alone the command changes [s].
    """
    places = reality.with_calibration(vehicle)
    return make_tethered_quadrotor(
        vehicle,
        reality.hung,
        wrench_effects=places.wrench,
        # What scales thrust acts behind the speed of the rotors.
        actuator_effects=sorted(
            places.actuator, key=lambda effect: not isinstance(effect, MotorLag)
        ),
        mass_effects=places.mass,
        command_period=command_period,
        onsets=reality.onsets,
        hangs_at=reality.hangs_at,
        events=events,
    )
