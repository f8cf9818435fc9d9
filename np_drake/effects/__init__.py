"""Physical effects that the nominal model leaves out, for simulation and for fitting; one pure
object a file.

`LIBRARY` holds those that the diagnosis searches, by identifier.
"""

from np_drake.lazy_names import lazy_names

_FILES = (  # in the order of the search; each holds the class that is named as it
    "mass_error",
    "inertia_error",
    "center_of_mass_offset",
    "suspended_payload",
    "thrust_scale",
    "thrust_drift",
    "weak_rotor",
    "motor_lag",
    "command_delay",
    "linear_drag",
    "quadratic_drag",
    "blade_flapping",
    "translational_lift",
    "rotor_inflow",
    "constant_wind",
    "gusty_wind",
    "ground_effect",
    "rotor_gyroscopic",
    "accelerometer_bias",
    "gyro_bias",
    "velocity_bias",
    "attitude_bias",
    "clock_offset",
    "mixer_gain",
    "torque_ratio",
    "thrust_ceiling",
    "battery_sag",
    "throttle_curve",
    "imu_mounting",
    "attitude_latency",
    "downwash",
    "disturbance",
    "sensor_noise",
)
NAMES = {file.title().replace("_", ""): f"np_drake.effects.{file}" for file in _FILES}
NAMES["LIBRARY"] = "np_drake.effects.library"
__getattr__, __dir__ = lazy_names(__name__, NAMES)
