"""Map of the names that Betaflight and Indiflight give, and which of them drive the rotors.

Source: Betaflight's blackbox fields and the units of its viewer. Those of Indiflight are measured:
its gyro against its attitude, the torque of its rotors against its gyro, on twelve logs.
"""

import math
import re

from np_drake.logs.formats.blackbox_body import ACCELEROMETER, GYRO, QUATERNION
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
    turned = "body" in contents and GYRO[0] in contents["body"]
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
