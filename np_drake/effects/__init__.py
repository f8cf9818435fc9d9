"""Physical effects that the nominal model leaves out, for simulation and for fitting; one pure object a file.

`LIBRARY` holds those that the diagnosis searches, by identifier.
"""

from typing import Any

from np_drake.lazy_names import lazy_name

NAMES = {
    "AccelerometerBias": "np_drake.effects.accelerometer_bias",
    "AttitudeBias": "np_drake.effects.attitude_bias",
    "AttitudeLatency": "np_drake.effects.attitude_latency",
    "BatterySag": "np_drake.effects.battery_sag",
    "BladeFlapping": "np_drake.effects.blade_flapping",
    "CenterOfMassOffset": "np_drake.effects.center_of_mass_offset",
    "ClockOffset": "np_drake.effects.clock_offset",
    "CommandDelay": "np_drake.effects.command_delay",
    "ConstantWind": "np_drake.effects.constant_wind",
    "Disturbance": "np_drake.effects.disturbance",
    "GroundEffect": "np_drake.effects.ground_effect",
    "GustyWind": "np_drake.effects.gusty_wind",
    "GyroBias": "np_drake.effects.gyro_bias",
    "ImuMounting": "np_drake.effects.imu_mounting",
    "InertiaError": "np_drake.effects.inertia_error",
    "LIBRARY": "np_drake.effects.library",
    "LinearDrag": "np_drake.effects.linear_drag",
    "MassError": "np_drake.effects.mass_error",
    "MixerGain": "np_drake.effects.mixer_gain",
    "MotorLag": "np_drake.effects.motor_lag",
    "QuadraticDrag": "np_drake.effects.quadratic_drag",
    "RotorGyroscopic": "np_drake.effects.rotor_gyroscopic",
    "RotorInflow": "np_drake.effects.rotor_inflow",
    "SensorNoise": "np_drake.effects.sensor_noise",
    "SuspendedPayload": "np_drake.effects.suspended_payload",
    "ThrottleCurve": "np_drake.effects.throttle_curve",
    "ThrustCeiling": "np_drake.effects.thrust_ceiling",
    "ThrustDrift": "np_drake.effects.thrust_drift",
    "ThrustScale": "np_drake.effects.thrust_scale",
    "TranslationalLift": "np_drake.effects.translational_lift",
    "VelocityBias": "np_drake.effects.velocity_bias",
    "WeakRotor": "np_drake.effects.weak_rotor",
}


def __getattr__(name: str) -> Any:
    return lazy_name(__name__, NAMES, name)


def __dir__() -> list[str]:
    return sorted([*globals(), *NAMES])
