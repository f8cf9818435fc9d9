"""Priors of the grey-box model in dimensionless form."""

import numpy as np

from np_drake.identification.parameters import Parameter

MOTORS, BOTH, SPEED = ("motors",), ("motors", "speed"), ("speed",)
AIR = ("velocity",)


def parameters(spin: float, step: float) -> tuple[Parameter, ...]:
    """Return the parameters of the model with their priors.

    Lengths count in mean arms, inertia in mass times squared arm.

    Args:
        spin: rotor speed in hover, or an estimate [rad/s].
        step: between rows of the logs [s].
    """
    ln = np.log
    return (
        Parameter("scale", 0.0, 1.0, log=True),  # thrust over mass, over that which hovers on the mean input
        # Gains of the rotors against each other: left to right, front to rear, by direction.
        Parameter("gain_roll", 0.0, 0.02),
        Parameter("gain_pitch", 0.0, 0.02),
        Parameter("gain_yaw", 0.0, 0.02),
        Parameter("com_x", 0.0, 0.05),
        Parameter("com_y", 0.0, 0.05),
        Parameter("jxx", ln(0.4), 0.4, log=True),
        Parameter("jyy", ln(0.4), 0.4, log=True),
        Parameter("jzz", ln(0.88), 0.12, log=True),  # over jxx + jyy, which a flat vehicle reaches
        Parameter("jxy", 0.0, 0.03),  # products over the mean of jxx and jyy
        Parameter("jxz", 0.0, 0.03),
        Parameter("jyz", 0.0, 0.03),
        Parameter("torque", ln(0.18), 0.4, log=True),  # torque over thrust of a rotor, over its radius
        Parameter("rotor_momentum", ln(0.002 * spin), 1.0, log=True),  # of a rotor in hover, over jzz [rad/s]
        Parameter("imu_x", 0.0, 0.2, needs=("accelerometer",)),
        Parameter("imu_y", 0.0, 0.2, needs=("accelerometer",)),
        Parameter("imu_z", 0.0, 0.2, needs=("accelerometer",)),
        Parameter("tilt_x", 0.0, 0.03, needs=("accelerometer",)),
        Parameter("tilt_y", 0.0, 0.03, needs=("accelerometer",)),
        Parameter("tilt_z", 0.0, 0.03, needs=("accelerometer",)),
        # Force and moment against velocity, over mass [1/s, 1/s, 1/m, arms/s, arms/s].
        Parameter("drag", 0.15, 0.15, needs=AIR),
        Parameter("climb", 0.15, 0.15, needs=AIR),
        Parameter("lift", 0.0, 0.1, needs=AIR),
        Parameter("flap_x", 0.0, 0.2, needs=AIR),
        Parameter("flap_y", 0.0, 0.2, needs=AIR),
        # Times [s]: rotor speed or command to body, accelerometer after gyro, first-order lags.
        Parameter("clock", 0.0, 0.01, needs=SPEED),
        Parameter("delay", 0.005, 0.01, needs=MOTORS),
        Parameter("force_late", 0.0, 0.005 + 0.3 * step),
        Parameter("window", 0.5, 0.3, needs=("accelerometer",)),  # over which it averages, of the interval of rows
        Parameter("lag", ln(0.03), 0.7, log=True, needs=MOTORS),
        Parameter("lag_ratio", ln(1.3), 0.3, log=True, needs=MOTORS),
        Parameter("curve", 0.2, 0.3, needs=("throttle",)),
        Parameter("sag", 1.5, 0.5, needs=("throttle", "voltage")),
        Parameter("full_speed", 0.0, 0.5, log=True, needs=BOTH),
        Parameter("bias_x", 0.0, 0.3, flight=True),
        Parameter("bias_y", 0.0, 0.3, flight=True),
        Parameter("bias_z", 0.0, 0.1, flight=True),
    )
