"""Map of PX4's own messages, in NED and FRD.   Source: PX4's message reference (uORB)."""

from np_drake.logs.formats.format import Contents, first_source
from np_drake.logs.formats.ulog_motors import motors, require_motors
from np_drake.logs.importing.interpolation import SLOWEST_ROTORS
from np_drake.logs.importing.log_map import LogMap, Source


def _indexed(name: str, count: int) -> list[str]:
    return [f"{name}[{i}]" for i in range(count)]


_RATES = (
    _indexed("vehicle_angular_velocity/xyz", 3),
    _indexed("sensor_combined/gyro_rad", 3),
    [f"vehicle_attitude/{axis}speed" for axis in ("roll", "pitch", "yaw")],
    _indexed("vehicle_odometry/angular_velocity", 3),
)
_FORCES = (
    _indexed("sensor_combined/accelerometer_m_s2", 3),
    _indexed("vehicle_acceleration/xyz", 3),
)


def default_map(contents: Contents) -> LogMap | None:
    """Return the map of PX4's own messages (NED, FRD); None without position and attitude.

    Rotor speed is measured, by the ESCs. Throttle is that of the motors where it is logged at 20 Hz
    or more, else collective. Torque setpoints are normalised and have no unit: they are left out.
    The velocity of an external vision is taken to be in body axes, as MAVLink's ODOMETRY has it.
    Raises: ValueError: if outputs move and nothing says which are motors.
    """
    position, velocity, odometry = _position(contents)
    found = LogMap(
        format="ulog",
        world="ned",
        body="frd",
        command="unknown",  # setpoints are logged at less than their own rate
        position=position,
        velocity=velocity,
        attitude=first_source(
            contents,
            (_indexed(f"{stream}/q", 4) for stream in ("vehicle_attitude", odometry)),
            order="wxyz",
            direction="body_to_world",
        ),
        rates=first_source(contents, _RATES, unit="rad/s", axes="body"),
        acceleration=first_source(
            contents, _FORCES, unit="m/s2", axes="body", kind="specific_force"
        ),
        rotor_speed=motors(contents, SLOWEST_ROTORS).rotor_speed,
        throttle=_throttle(contents),
        hover_throttle=first_source(contents, [["hover_thrust_estimate/hover_thrust"]], unit="1"),
        voltage=first_source(contents, [["battery_status/voltage_v"]], unit="V"),
    )
    if not found.tells_motion:
        return None
    if not (found.throttle or found.rotor_speed):
        require_motors(contents)
    return found


def _position(contents: Contents) -> tuple[Source, Source, str]:
    """Return position and velocity of one stream, and the odometry that may give the attitude."""
    odometry = next(
        (s for s in ("vehicle_odometry", "vehicle_visual_odometry") if s in contents), ""
    )
    for stream in ("vehicle_local_position", odometry):
        axes = "body" if stream == "vehicle_visual_odometry" else "world"
        places = [[f"{stream}/{axis}" for axis in "xyz"], _indexed(f"{stream}/position", 3)]
        speeds = [[f"{stream}/v{axis}" for axis in "xyz"], _indexed(f"{stream}/velocity", 3)]
        position = first_source(contents, places, unit="m")
        if position:
            return position, first_source(contents, speeds, unit="m/s", axes=axes), odometry
    return Source(), Source(), odometry


def _throttle(contents: Contents) -> Source:
    """Return throttle of four motors, else collective, else that of motors of another number or
    however slow.
    """
    own = motors(contents, SLOWEST_ROTORS).throttle
    if len(own.columns) == 4:
        return own
    collective = (
        first_source(contents, [["vehicle_thrust_setpoint/xyz[2]"]], unit="1", scale=-1.0)
        or first_source(contents, [["actuator_controls_0/control[3]"]], unit="1")
        or first_source(
            contents, [["vehicle_attitude_setpoint/thrust_body[2]"]], unit="1", scale=-1.0
        )
    )
    return collective or own or motors(contents).throttle
