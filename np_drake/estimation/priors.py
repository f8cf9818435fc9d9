"""What healthy vehicles differ by, and flights of one vehicle: one table of standard deviations.

Identification and diagnosis read it; some fields are of quantities that one of them alone has.
Inertia and the inertia of a rotor are those of published vehicles (`np_drake.vehicle.published`),
in the identification also torque over thrust and time constants. In a diagnosis a number that the
file of a vehicle states with an interval has the deviation of that interval.
"""

import dataclasses as dc

from np_drake.vehicle import Vehicle

LEAST_SHARE = 1e-3  # of a usual deviation, below which an interval is not taken at its word [1]


@dc.dataclass(frozen=True)
class Spread:
    """Standard deviations. Source: own choice, where a field names none.

    An arm is the mean distance of the rotors from their middle.
    """

    # Of a vehicle about its file.
    rotor_gain: float = 0.03  # thrust of one rotor [1]
    center_of_mass: float = 0.05  # in the plane of the rotors [arm]
    # Out of it [arm]; source: a battery of a third of the mass, a third of an arm over the rotors.
    center_of_mass_height: float = 0.1
    product_of_inertia: float = 0.03  # over the mean of xx and yy [1]
    lean: float = 0.2  # yaw torque of motors that lean, over their reaction torque [1]
    # Torque about each axis: rotors trim moments that no model has, sampled commands miss most of
    # it, and arms, torque over thrust and inertia are known by their ratio [1]; source: the usual
    # size of `mixer_gain`.
    torque_gain: float = 0.5
    drag: float = 0.15  # over mass, about a mean of the same size [1/s]
    flapping: float = 0.2  # moment against velocity, over mass [arm/s]
    # Thrust against velocity squared, over mass [1/m]; source: momentum theory, 1.3 over the square
    # of the induced velocity of hover, which is 4 to 8 m/s.
    lift: float = 0.06
    mounting: float = 0.02  # of the IMU against the rotors [rad]; source: one degree
    gyro_axes: float = 0.03  # of the gyro against the accelerometer [rad]
    imu_position: float = 0.2  # [arm]
    # of any accelerometer [m/s²]; source: data sheet of the BMI088, 20 mg
    accelerometer_offset: float = 0.2
    latency: float = 0.01  # of attitude against velocity [s]
    accelerometer_time: float = 0.005  # at which it is read against the gyro [s]
    command_time: float = 0.01  # at which a command acts [s]
    rotor_speed_time: float = 0.01  # at which measured rotor speed acts [s]
    lags: tuple[float, ...] = 0.01, 0.03, 0.08  # of rotors, each of which may act whole or not [s]
    idle: float = 0.04  # rotor speed at no throttle over full speed, about 0.05 [1]
    linear_throttle: float = 0.3  # linear share of thrust over throttle, about 0.2 [1]
    full_speed: float = 0.5  # rotor speed at full throttle, of its logarithm
    # Of a flight about its vehicle.
    # of the frame of the motion capture, or of an estimator [rad]; source: one degree
    tilt: float = 0.02
    gyro: float = 0.02  # bias [rad/s]
    velocity: float = 0.02  # bias [m/s]
    accelerometer: float = 0.1  # bias [m/s²]
    torque_share: float = 0.5  # share of torque that motion hides, over its mean [1]
    rotor_trim: float = 0.015  # thrust of one rotor, as a battery moves the centre of mass [1]
    center_of_mass_shift: float = 0.02  # in the plane of the rotors, as a battery moves [arm]
    yaw_trim: float = 0.02  # thrust of the rotors by their direction [1]
    charge: float = 0.03  # thrust over throttle and voltage [1]
    # Thrust over throttle, the voltage not known [1]; source: a cell at 3.6 to 4.1 V, thrust with
    # its power 1.5.
    unknown_charge: float = 0.06
    known_charge: float = 0.01  # thrust over rotor speed, or over a command in newtons [1]
    sag: float = 0.002  # rate of the thrust over throttle [1/s]
    # over throttle and voltage, rotor speed or a command in newtons [1/s]
    known_sag: float = 0.0005
    # Of a session about those before, between which a battery is taken out and put in again.
    # Centre of mass in the plane of the rotors [arm]; source: 0.5 mN·m of a Crazyflie of 34 g.
    session_shift: float = 0.03
    session_thrust: float = 0.0075  # [1]; source: 0.5 to 1 % of a Crazyflie
    # Slow changes within a flight.
    drift_time: float = 5.0  # between independent values [s]
    tilt_drift: float = 0.008  # of the attitude [rad]
    torque_drift: float = 0.01  # about roll and pitch [weight times arm]
    yaw_drift: float = 0.2  # about yaw, over that about roll [1]


HEALTHY = Spread()
FREEDOM = 2.0  # degrees of freedom of the prior of a variance between flights; own choice


def stated(vehicle: Vehicle, field: str, usual: float, *place: int) -> float:
    """Return the deviation of a number of a vehicle file: of its interval, else the usual one.

    Args:
        place: in a list or matrix, from 0.
    """
    known = vehicle.known_within(field, *place)
    return usual if known is None else max(known, LEAST_SHARE * usual)
