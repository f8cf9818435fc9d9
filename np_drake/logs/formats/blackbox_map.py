"""Map of the names that Betaflight and Indiflight give, which of them drive the rotors, and the
motion of the body of which a log writes other quantities: a part of a quaternion, or that of a
turned IMU.

Betaflight writes x, y and z of a quaternion whose w is not negative. Indiflight learns in flight
how its IMU is turned against the body that hovers (`hoverAttitude`, from the body to the IMU), and
its attitude is that of the body from then on, of the IMU before. As it begins to learn it forgets
how its IMU was turned in the flight before: its attitude jumps, and the axes of what comes before
are not told.
Source: Betaflight's blackbox fields and the units of its viewer. Those of Indiflight are measured:
its gyro against its attitude, the torque of its rotors against its gyro, on twelve logs.
"""

import math
import re
from collections.abc import Collection, Mapping

import numpy as np

from np_drake import attitude
from np_drake.logs.formats.format import Contents, Motors, first_source
from np_drake.logs.importing.log_map import LogMap, Source
from np_drake.vehicle.rotor_layout import FIRMWARE

MOTOR = re.compile(r"motor\[\d\]")
# Delay of a low-pass at low frequencies, over 1 / (2 pi cutoff), by its type: PT1, biquad, PT2, PT3
# [1]. Betaflight raises the cutoffs of the stages of the last two so that together they have the
# one that is set.
DELAYS = (1.0, 2**0.5, 2 * (2**0.5 - 1) ** 0.5, 3 * (2 ** (1 / 3) - 1) ** 0.5)
# the type of the accelerometer's; measured on Indiflight's logs: 7 to 7.5 ms below 30 Hz, where its
# is 7.6
PT2 = 2
GYRO_FILTERS = ("gyro_lpf1", "gyro_lpf2")
FINE = 0.1  # of a gyro in high resolution [1]
BODY = "body"
FULL = 32767.0  # of a component of Betaflight's quaternion that is 1
FORGETS = np.radians(20.0)  # turn between two rows that no vehicle makes; own choice
AXES = range(3)
QUATERNION = [f"quat[{i}]" for i in range(4)]
GYRO, ACCELEROMETER = [f"gyro[{i}]" for i in AXES], [f"acc[{i}]" for i in AXES]
VECTOR_PART = [f"imuQuaternion[{i}]" for i in AXES]
TURNED = [
    f"{name}[{i}]" for name, count in (("hoverAttitude", 4), ("quat", 4)) for i in range(count)
]
IMU = [f"{name}[{i}]" for name in ("gyroADC", "accSmooth") for i in AXES]


def default_map(contents: Contents) -> LogMap | None:
    """Return the map of the firmware's own names; None of another firmware.

    Betaflight's axes are x forward, y left, z up, and so are those of Indiflight's sensors unless
    it learns how they are turned; its estimates are in NED and FRD. The attitude integrates the
    filtered gyro, and is as late. Rotor speed is measured: Indiflight's without its filter, which
    is 15 ms late. Throttle is what is sent to the motors, 0 where they idle; Indiflight's `u` is
    the thrust that it asks for, over the largest one.
    """
    told = _parameters(contents)
    indiflight = "indiflight" in told
    if not indiflight and "betaflight" not in told:
        return None
    turned = GYRO[0] in contents.get(BODY, ())
    body = "frd" if turned else "flu"
    scale = told.get("gyro_scale", 1.0) * (
        FINE if told.get("blackbox_high_resolution", 0) > 0 else 1.0
    )
    driven, delay = motors(contents), _gyro_delay(told)
    quaternion = ([f"body/{n}" for n in QUATERNION], [f"main/{n}" for n in QUATERNION])
    rates = ([f"body/{n}" for n in GYRO], _indexed("gyroADC", 3))
    forces = (
        ([f"body/{n}" for n in ACCELEROMETER], _indexed("accSmooth", 3))
        if told.get("acc_1G", 0) >= 1
        else ()
    )
    return LogMap(
        format="blackbox",
        world="ned" if indiflight else "enu",
        body="frd" if indiflight else "flu",
        command="held_after" if told.get("P interval", 1.0) == 1 else "sampled",
        position=first_source(contents, [_indexed("pos", 3)], unit="mm")
        if indiflight
        else Source(),
        velocity=first_source(contents, [_indexed("vel", 3)], unit="cm/s", axes="world")
        if indiflight
        else Source(),
        attitude=first_source(
            contents, quaternion, order="wxyz", direction="body_to_world", late=delay
        ),
        rates=first_source(
            contents, rates, unit="deg/s", scale=scale, axes="body", body=body, late=delay
        ),
        acceleration=first_source(
            contents,
            forces,
            unit="g",
            scale=1 / max(told.get("acc_1G", 1.0), 1.0),
            axes="body",
            kind="specific_force",
            body=body,
            late=_delay(told.get("acc_lpf_hz", 0.0) / 100, PT2),
        ),
        rotor_speed=driven.rotor_speed,
        throttle=driven.throttle,
        voltage=_voltage(contents, told),
        commanded_rates=_setpoint(contents, indiflight),
    )


def motors(contents: Contents) -> Motors:
    """Return the motors of a log, and their layout, that of Betaflight's Quad X, where they are
    four.
    """
    told = _parameters(contents)
    columns = [name for name in contents.get("main", ()) if MOTOR.fullmatch(name)]
    ends = [
        told.get(f"motorOutput[{i}]", told.get(old, 0.0))
        for i, old in enumerate(("minthrottle", "maxthrottle"))
    ]
    whole = len(columns) in (4, 6, 8) and ends[0] < ends[1]
    throttle = Source([f"main/{name}" for name in columns], "us", ends=ends) if whole else Source()
    if len(columns) != 4:
        told_of = (
            f"{len(columns)} motors: their collective thrust alone is taken, torque is not told"
        )
        return Motors(throttle, notes=(told_of,) if columns else ())
    speed = first_source(
        contents, (_indexed(name, 4) for name in ("omegaUnfiltered", "omega")), unit="rad/s"
    )
    if (
        not speed and told.get("motor_poles", 0) > 0
    ):  # written in hundreds of electrical revolutions a minute
        names = (_indexed(name, 4) for name in ("eRPM", "eRPM(/100)"))
        speed = first_source(contents, names, unit="rpm", scale=200 / told["motor_poles"])
    return Motors(throttle, speed, FIRMWARE["betaflight"])


def _parameters(contents: Contents) -> dict[str, float]:
    return getattr(contents, "parameters", {})


def _indexed(name: str, count: int) -> list[str]:
    return [f"main/{name}[{i}]" for i in range(count)]


def _voltage(contents: Contents, told: dict[str, float]) -> Source:
    """Return the voltage of the battery; none of a firmware that writes the reading of its
    converter.
    """
    version = told.get("betaflight", 4.0)
    found = first_source(
        contents, [["main/vbatLatest"]], unit="V", scale=0.01 if version >= 4 else 0.1
    )
    return found if version >= 3.01 else Source()  # 3.1


def _setpoint(contents: Contents, indiflight: bool) -> Source:
    """Return the rates that the controller is asked for, as logged beside the gyro; none of
    Indiflight's.
    """
    if indiflight:
        return Source()
    return first_source(contents, [_indexed("setpoint", 3)], unit="deg/s", axes="body", body="flu")


def _gyro_delay(told: dict[str, float]) -> float:
    """Return the delay of the filters of the gyro whose cutoff the header states [s]; the moving
    ones are left out.
    """
    found = 0.0
    for name in GYRO_FILTERS:
        if not told.get(f"{name}_dyn_hz[0]", 0.0) > 0:
            found += _delay(told.get(f"{name}_static_hz", 0.0), int(told.get(f"{name}_type", 0.0)))
    return found


def _delay(cutoff: float, kind: int) -> float:
    """Return the delay of a low-pass [s] by its cutoff [Hz] and its type; 0 of one that is off or
    not known.
    """
    return DELAYS[kind] / (2 * math.pi * cutoff) if cutoff > 0 and 0 <= kind < len(DELAYS) else 0.0


def body_columns(names: Collection[str]) -> tuple[str, ...]:
    """Return the columns of the body that follow from those of the main frames; none: all are
    written as they are.
    """
    if set(VECTOR_PART) <= set(names):
        return tuple(QUATERNION)
    return (*QUATERNION, *GYRO, *ACCELEROMETER) if {*TURNED, *IMU} <= set(names) else ()


def needed(names: Collection[str]) -> list[str]:
    """Return the columns of the main frames from which those of the body follow."""
    return VECTOR_PART if set(VECTOR_PART) <= set(names) else [*TURNED, *IMU]


def body_values(main: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Return the columns of the body (n,).

    Args:
        main: those that are needed (n,), in the units of the file, which remain.
    """
    if VECTOR_PART[0] in main:
        xyz = np.stack([main[name] for name in VECTOR_PART])
        w = np.sqrt(np.maximum(FULL**2 - np.sum(xyz**2, axis=0), 0.0))
        return dict(zip(QUATERNION, (w, *xyz), strict=True))
    turn, logged = (
        np.stack([main[f"{name}[{i}]"] for i in range(4)], axis=1)
        for name in ("hoverAttitude", "quat")
    )
    turn = turn / np.maximum(np.linalg.norm(turn, axis=1, keepdims=True), 1.0)
    final = np.broadcast_to(turn[-1:], turn.shape)
    logged = logged / np.maximum(np.linalg.norm(logged, axis=1, keepdims=True), 1.0)
    of_imu = attitude.multiply(logged, attitude.conjugate(turn))
    found = dict(zip(QUATERNION, attitude.multiply(of_imu, final).T, strict=True))
    for name, columns in (("gyroADC", GYRO), ("accSmooth", ACCELEROMETER)):
        vector = np.stack([main[f"{name}[{i}]"] for i in AXES], axis=1)
        found |= zip(columns, attitude.rotate_back(final, vector).T, strict=True)
    told = _told(of_imu, turn)
    return {name: np.where(told, values, np.nan) for name, values in found.items()}


def _told(of_imu: np.ndarray, turn: np.ndarray) -> np.ndarray:
    """Return the rows (n,) behind the last at which the IMU's attitude jumps before any turn of it
    is learnt.
    """
    steps = attitude.rotation_vector(attitude.multiply(attitude.conjugate(of_imu[:-1]), of_imu[1:]))
    unlearnt = np.all(turn[1:, 1:] == 0, axis=1)
    jumps = np.flatnonzero(unlearnt & (np.linalg.norm(steps, axis=1) > FORGETS))
    return np.arange(len(of_imu)) > (jumps[-1] if len(jumps) else -1)
