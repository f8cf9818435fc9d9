"""What acts on the simulated vehicle and its sensors beyond the model that the controller
assumes.
"""

import dataclasses as dc

import numpy as np

from np_drake.effects.base import (
    ActuatorEffect,
    Effect,
    MassEffect,
    MeasurementEffect,
    WrenchEffect,
)
from np_drake.effects.combine import acting, require_complete, split_effects
from np_drake.effects.command_delay import CommandDelay
from np_drake.effects.disturbance import Disturbance, DisturbanceConfig
from np_drake.effects.effect_entry import EffectEntry, Posterior
from np_drake.effects.gusty_wind import GustyWind
from np_drake.effects.linear_drag import LinearDrag
from np_drake.effects.motor_lag import MotorLag, at_once
from np_drake.effects.sensor_noise import SensorNoise
from np_drake.effects.suspended_payload import SuspendedPayload
from np_drake.effects.thrust_drift import ThrustDrift
from np_drake.effects.thrust_scale import ThrustScale
from np_drake.vehicle.vehicle import MeasurementNoise, Vehicle
from systems.payload_config import PayloadConfig, as_light, payload_config


@dc.dataclass
class RealityConfig:
    """Differences of the real vehicle from the one that the controller assumes."""

    payload: PayloadConfig = dc.field(default_factory=PayloadConfig)
    rotor_drag: float = 0.25  # on each body axis; 0 for none [N·s/m]
    motor_lag: float = 0.03  # time constant of the rotor speed; 0 for none [s]
    command_delay: float = (
        0.0  # time from a command to its effect on the rotors, beyond their lag [s]
    )
    thrust_scale: float = 0.96  # real over nominal thrust at the start [1]
    thrust_loss: float = (
        0.0  # share of the starting thrust that a falling battery takes each second [1/s]
    )
    noise: MeasurementNoise = dc.field(default_factory=lambda: MeasurementNoise(attitude=0.003))
    wind: list[float] = dc.field(
        default_factory=lambda: [0.0, 0.0, 0.0]
    )  # mean, in W; the drag feels it [m/s]
    gust: float = 0.0  # standard deviation of each axis of the wind, correlated over 1 s [m/s]
    gust_seed: int = 0  # of the wind's gusts
    # Act besides all of these, each from its onset on; a suspended payload here needs `payload:
    # {tether: none}`.
    effects: list[EffectEntry] = dc.field(default_factory=list)
    disturbance: DisturbanceConfig = dc.field(
        default_factory=DisturbanceConfig
    )  # random, none unless named
    posterior: Posterior = dc.field(
        default_factory=Posterior
    )  # joint, of the parameters of `effects`

    def check(self) -> "RealityConfig":
        """Return self after checking all values.

        Raises: ValueError: on an impossible effect.
        """
        self.payload.check()
        self.noise.check()
        for name in ("rotor_drag", "motor_lag", "command_delay", "thrust_loss", "gust"):
            if not 0 <= getattr(self, name) < np.inf:
                raise ValueError(
                    f"RealityConfig: {name} must not be negative; got {getattr(self, name)}."
                )
        if not self.thrust_scale > 0:
            raise ValueError(
                f"RealityConfig: thrust_scale must be positive; got {self.thrust_scale}."
            )
        if np.shape(self.wind) != (3,) or not np.isfinite(self.wind).all():
            raise ValueError(
                f"RealityConfig: wind must be three finite speeds [m/s]; got {self.wind}."
            )
        if self.blows and not self.rotor_drag > 0:
            raise ValueError(
                "RealityConfig: wind acts through rotor_drag, which must then be positive."
            )
        for entry in self.effects:
            entry.check()
        require_complete(self.added)
        self.disturbance.check()
        self.posterior.check()
        hung = split_effects(self.added).payload
        if hung is not None and self.payload.tether != "none":
            raise ValueError(
                "RealityConfig: there must be one payload; got `payload` and the effect "
                "suspended_payload. Write "
                "payload: {tether: none} beside the effect."
            )
        return self

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
    def by_flight(self) -> list[tuple[Effect, dict[str, float | None]]]:
        """The effects of `effects` with their onsets by flight of the diagnosis, as `DrakeReplay`
        takes them.
        """
        return [(entry.made, {**entry.onsets}) for entry in self.effects]

    @property
    def onsets(self) -> dict[Effect, float]:
        """When those of `effects` begin that do not act from the start [s]."""
        return {entry.made: entry.onset for entry in self.effects if entry.onset}

    @property
    def hangs_at(self) -> float:
        """When the payload is hung; 0 from the start [s]."""
        effect = split_effects(self.added).payload
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
        effect = split_effects(self.added).payload
        return self.payload if effect is None else as_light(payload_config(effect))

    @property
    def blows(self) -> bool:
        """Whether there is any wind."""
        return bool(np.any(self.wind)) or self.gust > 0

    def wrench_effects(self) -> list[WrenchEffect]:
        """Return the effects that add a wrench to the body, or move the air."""
        d = self.rotor_drag
        effects: list[WrenchEffect] = [LinearDrag(d, d, d)] if d > 0 else []
        if self.blows:
            x, y, z = self.wind
            effects.append(GustyWind(x, y, z, deviation=self.gust, seed=self.gust_seed))
        effects += split_effects(self.added).wrench
        return (
            [*effects, Disturbance.of_config(self.disturbance)]
            if self.disturbance.acts
            else effects
        )

    def actuator_effects(self) -> list[ActuatorEffect]:
        """Return the effects between command and thrust, in the order of action."""
        effects: list[ActuatorEffect] = (
            [CommandDelay(self.command_delay)] if self.command_delay > 0 else []
        )
        effects += [MotorLag(self.motor_lag)] if self.motor_lag > 0 else []
        effects += [ThrustScale(self.thrust_scale)] if self.thrust_scale != 1.0 else []
        effects += [ThrustDrift(1.0, -self.thrust_loss)] if self.thrust_loss > 0 else []
        return effects + [e for e in split_effects(self.added).actuator if not at_once(e)]

    def mass_effects(self) -> list[MassEffect]:
        """Return the effects on the mass properties."""
        return split_effects(self.added).mass

    def sensor_effects(self) -> list[MeasurementEffect]:
        """Return what the sensors do, noise last; a shifted clock is left out (`clock_shift`)."""
        found = [e for e in split_effects(self.added).measurement if not _clock_shift(e)]
        return [*found, SensorNoise(self.noise)]

    @property
    def clock_shift(self) -> float:
        """Time by which state rows of the log run ahead of the commands [s]."""
        return sum(_clock_shift(e) for e in split_effects(self.added).measurement)

    def everything(self) -> list[Effect | MeasurementEffect]:
        """Return all effects, a payload among them; the noise of sensors is none."""
        payload = split_effects(self.added).payload
        if payload is None and self.hung.tether != "none":
            hung = self.hung
            x, y, z = hung.hook
            payload = SuspendedPayload(hung.mass, hung.length, x, y, z, hung.air_damping)
        found: list[Effect | MeasurementEffect] = [*self.mass_effects(), *self.actuator_effects()]
        found += [*self.wrench_effects(), *([payload] if payload else [])]
        return [*found, *split_effects(self.added).measurement]

    def thrust_at(self, vehicle: Vehicle, t: float, *, failing: bool = True) -> float:
        """Return real over nominal thrust, mean of the rotors [1].

        Args:
            t: time since the start [s].
        """
        thrust = np.ones(4)
        for effect in acting(self.actuator_effects(), self.onsets, t if failing else 0.0):
            thrust = effect.thrust(vehicle, effect.state_at(vehicle, thrust), thrust, t)
        return float(thrust.mean())


def _clock_shift(effect: MeasurementEffect) -> float:
    return float(getattr(effect, "clock_shift", 0.0))
