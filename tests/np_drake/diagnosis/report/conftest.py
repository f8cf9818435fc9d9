"""Diagnoses made by hand for the report: a payload attached in mid-flight, and drag."""

import numpy as np
import pytest

from np_drake.diagnosis import result as an

HELD_OUT = ("heldout_1", "heldout_2")
NOISE = (0.05, 0.05, 0.08, 0.004, 0.004, 0.002)  # [N, N·m]
SIZE = (8.0, 7.0, 22.0, 3.0, 2.6, 1.3)  # of the gap in noise units


def replay(scale: float) -> an.ReplayGap:
    grown = np.array([0.01, 0.06, 0.22, 0.85])[:, None]
    size = scale * grown * np.array([1.0, 0.85, 1.2])
    return an.ReplayGap(an.HORIZONS, size, 2.1 * size, 9.0 * size, 48)


def where() -> an.Localisation:
    channels = tuple(
        an.ChannelGap(channel, "N" if k < 3 else "N·m", noise * size, noise, 1.08 * noise)
        for k, (channel, noise, size) in enumerate(zip(an.CHANNELS, NOISE, SIZE, strict=True))
    )
    sizes = (9.0,) * 6, (1.0,) * 6
    speeds = tuple(an.Regime("speed", "m/s", k, k + 1.0, 100, *sizes) for k in range(4))
    return an.Localisation(channels, speeds)


def payload() -> an.Cause:
    return an.Cause(
        "suspended_payload",
        0.984,
        {
            "mass": an.Estimate(0.2604, "kg", (0.2551, 0.2658)),
            "length": an.Estimate(0.812, "m", (0.774, 0.853)),
            "hook_x": an.Estimate(0.0004, "m", (-0.0041, 0.0049)),
            "hook_y": an.Estimate(-0.0011, "m", (-0.0058, 0.0036)),
            "hook_z": an.Estimate(-0.0262, "m", (-0.0334, -0.0190)),
        },
        {"train_1": None, "train_2": 11.42, "heldout_1": None, "heldout_2": 8.02},
        share=0.94,
    )


def drag() -> an.Cause:
    d = {axis: an.Estimate(0.24, "N·s/m", (0.21, 0.27)) for axis in ("d_x", "d_y", "d_z")}
    flights = ("train_1", "train_2", *HELD_OUT)
    return an.Cause("linear_drag", 0.93, d, dict.fromkeys(flights), ("quadratic_drag",), 0.03)


def check() -> an.Identifiability:
    noise = dict(zip(an.CHANNELS, NOISE, strict=True))
    moved = {"speed, RMS [m/s]": 1.84, "thrust, span [N]": 11.2, "tilt, RMS [deg]": 9.7}
    return an.Identifiability(True, moved, noise, ("heldout_2: smoothed above 15 Hz.",))


def calibration() -> tuple[an.Difference, ...]:
    rotor, tilt = (0.02, 0.06), (0.006, 0.026)
    return (
        an.Difference("weak_rotor[2].efficiency", "rotor 2: +4 %", 0.04, "share", 0.03, rotor),
        an.Difference("attitude_bias.pitch", "reads +0.92° of pitch", 0.016, "rad", 0.02, tilt),
    )


@pytest.fixture(scope="session")
def diagnosis() -> an.Diagnosis:
    left = an.Remainder(0.002, (0.001, 0.009), 0.044, 0.0024, 0.013, 0.85, 0.03)
    gap_reduction = an.GapReduction(9.84, 1.08, left, replay(1.0), replay(0.07))
    text = "0.002 rad/s about x: too small to move the vehicle."
    minor = an.ResidualFinding("gyro_bias", text, 0.004, {"x [rad/s]": 0.002})
    return an.Diagnosis(
        "paper",
        ("train_1", "train_2"),
        HELD_OUT,
        ("suspended_payload", "linear_drag"),
        (payload(), drag()),
        check(),
        where(),
        gap_reduction,
        (minor,),
        unknown_probability=0.03,
        wall=21.4,
        calibration=calibration(),
    )
