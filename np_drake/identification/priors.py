"""Priors of the grey-box model in dimensionless form."""

import numpy as np

from np_drake.identification.parameters import Parameter
from np_drake.vehicle.published import published_priors

MOTORS, BOTH, SPEED = ("motors",), ("motors", "speed"), ("speed",)
AIR = ("velocity",)


def parameters(spin: float, step: float) -> tuple[Parameter, ...]:
    """Return the parameters of the model with their priors.

    Lengths count in mean arms, inertia in mass times squared arm.

    Args:
        spin: rotor speed in hover, or an estimate [rad/s].
        step: between rows of the logs [s].
    """
    ln, known = np.log, published_priors()
    # Jxx of any vehicle, and Jyy over it, with the variance that both share.
    moment, yaw = known.inertia, known.inertia_yaw
    zz = moment.mean + ln(1.0 + known.inertia_pitch.median) + yaw.mean
    return (
        Parameter(
            "scale", 0.0, 1.0, log=True
        ),  # thrust over mass, over that which hovers on the mean input
        # Gains of the rotors against each other: left to right, front to rear, by direction.
        Parameter("gain_roll", 0.0, 0.03),
        Parameter("gain_pitch", 0.0, 0.03),
        Parameter("gain_yaw", 0.0, 0.03),
        Parameter("com_x", 0.0, 0.05),
        Parameter("com_y", 0.0, 0.05),
        Parameter("jxx", moment.mean, moment.deviation, log=True),
        Parameter(
            "jyy", known.inertia_pitch.mean, known.inertia_pitch.deviation, log=True
        ),  # over jxx
        Parameter(
            "jzz", yaw.mean, yaw.deviation, log=True
        ),  # over jxx + jyy, which a flat vehicle reaches
        Parameter("jxy", 0.0, 0.03),  # products over the mean of jxx and jyy
        Parameter("jxz", 0.0, 0.03),
        Parameter("jyz", 0.0, 0.03),
        # Torque over thrust of a rotor, over its radius.
        Parameter("torque", known.torque_lever.mean, known.torque_lever.deviation, log=True),
        Parameter("lean_x", 0.0, 0.2),  # yaw of motors that lean, over their torque
        Parameter("lean_y", 0.0, 0.2),
        # Angular momentum of a rotor in hover, over jzz [rad/s].
        Parameter(
            "rotor_momentum",
            known.rotor_inertia.mean - zz + ln(spin),
            known.rotor_inertia.deviation,
            log=True,
        ),
        Parameter("imu_x", 0.0, 0.2, needs=("accelerometer",)),
        Parameter("imu_y", 0.0, 0.2, needs=("accelerometer",)),
        Parameter("imu_z", 0.0, 0.2, needs=("accelerometer",)),
        Parameter("tilt_x", 0.0, 0.03, needs=("accelerometer",)),
        Parameter("tilt_y", 0.0, 0.03, needs=("accelerometer",)),
        Parameter("tilt_z", 0.0, 0.03, needs=("accelerometer",)),
        # What rolls, pitches and yaws are coupled by beside tilt and products of inertia.
        Parameter("twist_x", 0.0, 0.03),
        Parameter("twist_y", 0.0, 0.03),
        Parameter("twist_z", 0.0, 0.03),
        # Force and moment against velocity, over mass [1/s, 1/s, 1/m, arms/s, arms/s].
        Parameter("drag", 0.15, 0.15, needs=AIR),
        Parameter("climb", 0.15, 0.15, needs=AIR),
        Parameter("lift", 0.0, 0.1, needs=AIR),
        Parameter("flap_x", 0.0, 0.2, needs=AIR),
        Parameter("flap_y", 0.0, 0.2, needs=AIR),
        # Times [s]: command to body, accelerometer after gyro, first-order lags.
        Parameter("delay", 0.005, 0.01, needs=MOTORS),
        Parameter("force_late", 0.0, 0.005 + 0.3 * step),
        Parameter(
            "window", 0.5, 0.3, needs=("accelerometer",)
        ),  # over which it averages, of the interval of rows
        Parameter(
            "lag", known.time_constant.mean, known.time_constant.deviation, log=True, needs=MOTORS
        ),
        Parameter(
            "lag_ratio",
            known.time_constant_down.mean,
            known.time_constant_down.deviation,
            log=True,
            needs=MOTORS,
        ),
        Parameter("curve", 0.2, 0.3, needs=("throttle",)),
        Parameter("idle", 0.05, 0.04, needs=("throttle",)),
        Parameter("sag", 1.5, 0.5, needs=("throttle", "voltage")),
        Parameter("full_speed", 0.0, 0.5, log=True, needs=BOTH),
        # Of one flight: battery and where it lies, clocks, errors of sensors.
        Parameter("charge", 0.0, 0.03, log=True, flight=True),  # thrust over that of all flights
        Parameter("shift_x", 0.0, 0.02, flight=True),  # centre of mass against that of all flights
        Parameter("shift_y", 0.0, 0.02, flight=True),
        Parameter("shift_yaw", 0.0, 0.02, flight=True),  # gain about z against that of all flights
        Parameter("clock", 0.0, 0.01, flight=True, needs=SPEED),  # rotor speed to body [s]
        Parameter(
            "heading", 0.0, 0.02, flight=True, needs=AIR
        ),  # of the attitude against the sensors [rad]
        Parameter("bias_x", 0.0, 0.3, flight=True),
        Parameter("bias_y", 0.0, 0.3, flight=True),
        Parameter("bias_z", 0.0, 0.1, flight=True),
    )
