"""Map of the messages that ArduPilot writes, in NED and FRD.   Source: ArduPilot's log message
reference.
"""

from np_drake.logs.formats.dataflash_motors import motors
from np_drake.logs.formats.format import Contents, first_source
from np_drake.logs.importing.log_map import LogMap, Source


def default_map(contents: Contents) -> LogMap | None:
    """Return the map of the names that ArduPilot gives; None without an IMU, or attitude and
    position.

    Position, velocity and attitude are those of the primary core of the EKF, else the first. Body
    rates and acceleration are those of the first IMU, with its biases. Motors are those that the
    parameters name, else on the outputs 1 to 4.
    Raises: ValueError: if the frame is none that a vehicle file can hold, or an output of a motor
        is not logged.
    """
    ekf = _first(contents, ("XKF1", "NKF1"), ("PN", "PE", "PD", "VN", "VE", "VD"))
    attitude = _attitude(contents)
    imu = _first(contents, ("IMU",), ("GyrX", "GyrY", "GyrZ", "AccX", "AccY", "AccZ"))
    if not (imu or (attitude and ekf)):
        return None
    driven = motors(contents)
    battery = _first(contents, ("BAT", "CURR"), ("Volt",))
    throttle, hover = driven.throttle, Source()
    if not throttle:
        throttle = Source(_first(contents, ("CTUN",), ("ThO",)))
        hover = Source(_first(contents, ("CTUN",), ("ThH",)))
    return LogMap(
        format="dataflash",
        world="ned",
        body="frd",
        command="unknown",  # setpoints are logged at less than their own rate
        position=Source(ekf[:3]),
        velocity=Source(ekf[3:], axes="world"),
        attitude=attitude or Source(),
        rates=Source(imu[:3]),
        acceleration=Source(imu[3:], kind="specific_force", axes="body"),
        rotor_speed=driven.rotor_speed,
        throttle=throttle,
        hover_throttle=hover if throttle else Source(),
        voltage=Source(battery),
    )


def _attitude(contents: Contents) -> Source | None:
    quaternion = ("Q1", "Q2", "Q3", "Q4")
    for names in (("XKQ", "XKQ1", "NKQ", "NKQ1"), ("ATT",), ("AHR2",)):
        columns = _first(contents, names, quaternion)
        if columns:
            return Source(columns, order="wxyz", direction="body_to_world")
        columns = _first(contents, names, ("Roll", "Pitch", "Yaw"))
        if columns:
            return Source(columns, "deg")
    return None


def _first(contents: Contents, names: tuple[str, ...], columns: tuple[str, ...]) -> list[str]:
    """Return `stream/column` of the first message that has all columns: its primary or first
    instance, if numbered.
    """
    streams = (stream for name in names for stream in (f"{name}.primary", f"{name}.0", name))
    return first_source(
        contents, ([f"{stream}/{column}" for column in columns] for stream in streams)
    ).columns
