"""Physical effects that the nominal model leaves out, for simulation and for fitting; one pure object a file.

`LIBRARY` holds those that the diagnosis searches, by identifier.
"""

from np_drake.lazy_names import lazy_names

_FILES = (  # each holds the class that is named as it
    *("mass_error", "inertia_error", "center_of_mass_offset", "suspended_payload"),
    *("thrust_scale", "thrust_drift", "thrust_ceiling", "throttle_curve", "battery_sag", "weak_rotor"),
    *("motor_lag", "command_delay", "mixer_gain", "rotor_gyroscopic", "rotor_inflow"),
    *("linear_drag", "quadratic_drag", "blade_flapping", "translational_lift", "ground_effect"),
    *("constant_wind", "gusty_wind", "disturbance", "sensor_noise", "clock_offset", "attitude_latency"),
    *("accelerometer_bias", "gyro_bias", "velocity_bias", "attitude_bias", "imu_mounting"),
)
NAMES = {file.title().replace("_", ""): f"np_drake.effects.{file}" for file in _FILES}
NAMES["LIBRARY"] = "np_drake.effects.library"
__getattr__, __dir__ = lazy_names(__name__, NAMES)
