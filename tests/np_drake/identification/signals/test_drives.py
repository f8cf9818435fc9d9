"""Laws of the input that several logs share."""

import dataclasses as dc

import numpy as np
import pytest

from np_drake.flight_log import FlightLog
from np_drake.identification.signals import common_drive, left_out


def log(name: str, **more) -> FlightLog:
    """Return a log at rest."""
    zeros, q = np.zeros((20, 3)), np.tile([1.0, 0.0, 0.0, 0.0], (20, 1))
    return FlightLog(
        0.01 * np.arange(20), zeros, q, zeros, zeros, np.ones((20, 4)), name=name, **more
    )


ROTORS = {"rotor": np.ones((20, 4)), "input": "rotor_speed"}
THROTTLES = {"throttle": np.full((20, 4), 0.5)}


def test_flights_are_read_by_what_all_of_them_hold():
    logs = [log("a", **ROTORS, **THROTTLES), log("b", **THROTTLES, input="normalised")]
    assert common_drive(logs) == "throttle"
    (said,) = left_out(logs, "throttle")
    assert said.startswith("throttle alone counts, as all logs hold it; rotor_speed of a is left")
    assert left_out(logs[:1], "rotor_speed") == left_out(logs[1:], "throttle") == []


def test_flights_without_an_input_in_common_are_refused_by_name():
    with pytest.raises(ValueError, match="a rotor_speed; b command"):
        common_drive([log("a", **ROTORS), log("b")])


def test_a_log_without_any_throttle_or_torque_is_refused():
    with pytest.raises(ValueError, match="c: identification needs what turns the rotors"):
        common_drive([dc.replace(log("c"), input="thrust_only")])


def test_one_throttle_for_all_rotors_is_the_least_telling_of_all():
    one = log("d", throttle=np.full((20, 1), 0.5), input="normalised")
    assert common_drive([one]) == "collective"
    assert common_drive([log("b", **THROTTLES, input="normalised"), one]) == "collective"
    with pytest.raises(ValueError, match="b command; d collective"):
        common_drive([log("b"), one])
