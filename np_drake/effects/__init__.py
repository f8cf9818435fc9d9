"""Physical effects that the nominal model leaves out, for simulation and for fitting; one pure
object a file.

`LIBRARY` holds those that the diagnosis searches, by identifier.
"""

from typing import TYPE_CHECKING

from np_drake.lazy_names import lazy_names

if TYPE_CHECKING:  # in the order of the search
    __all__: list[str]
    from np_drake.effects.mass_error import MassError as MassError
    from np_drake.effects.inertia_error import InertiaError as InertiaError
    from np_drake.effects.center_of_mass_offset import CenterOfMassOffset as CenterOfMassOffset
    from np_drake.effects.suspended_payload import SuspendedPayload as SuspendedPayload
    from np_drake.effects.thrust_scale import ThrustScale as ThrustScale
    from np_drake.effects.thrust_drift import ThrustDrift as ThrustDrift
    from np_drake.effects.weak_rotor import WeakRotor as WeakRotor
    from np_drake.effects.motor_lag import MotorLag as MotorLag
    from np_drake.effects.command_delay import CommandDelay as CommandDelay
    from np_drake.effects.linear_drag import LinearDrag as LinearDrag
    from np_drake.effects.quadratic_drag import QuadraticDrag as QuadraticDrag
    from np_drake.effects.blade_flapping import BladeFlapping as BladeFlapping
    from np_drake.effects.translational_lift import TranslationalLift as TranslationalLift
    from np_drake.effects.rotor_inflow import RotorInflow as RotorInflow
    from np_drake.effects.constant_wind import ConstantWind as ConstantWind
    from np_drake.effects.gusty_wind import GustyWind as GustyWind
    from np_drake.effects.ground_effect import GroundEffect as GroundEffect
    from np_drake.effects.rotor_gyroscopic import RotorGyroscopic as RotorGyroscopic
    from np_drake.effects.accelerometer_bias import AccelerometerBias as AccelerometerBias
    from np_drake.effects.gyro_bias import GyroBias as GyroBias
    from np_drake.effects.velocity_bias import VelocityBias as VelocityBias
    from np_drake.effects.attitude_bias import AttitudeBias as AttitudeBias
    from np_drake.effects.clock_offset import ClockOffset as ClockOffset
    from np_drake.effects.mixer_gain import MixerGain as MixerGain
    from np_drake.effects.torque_ratio import TorqueRatio as TorqueRatio
    from np_drake.effects.thrust_ceiling import ThrustCeiling as ThrustCeiling
    from np_drake.effects.attached_mass import AttachedMass as AttachedMass
    from np_drake.effects.battery_sag import BatterySag as BatterySag
    from np_drake.effects.throttle_curve import ThrottleCurve as ThrottleCurve
    from np_drake.effects.imu_mounting import ImuMounting as ImuMounting
    from np_drake.effects.attitude_latency import AttitudeLatency as AttitudeLatency
    from np_drake.effects.downwash import Downwash as Downwash
    from np_drake.effects.disturbance import Disturbance as Disturbance
    from np_drake.effects.sensor_noise import SensorNoise as SensorNoise
    from np_drake.effects.library import LIBRARY as LIBRARY
else:
    __getattr__, __dir__, __all__ = lazy_names(__name__, __file__)
