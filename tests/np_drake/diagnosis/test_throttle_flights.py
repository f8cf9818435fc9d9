"""Flights of throttle alone, of which no scale is known: what hangs below or is taken up shows all
the same.
"""

import dataclasses as dc

import numpy as np
import pytest

from np_drake.diagnosis.diagnose import diagnose
from np_drake.effects.mass_error import MassError
from np_drake.effects.suspended_payload import SuspendedPayload
from np_drake.vehicle import load_vehicle

VEHICLE = load_vehicle("paper")
EXPONENT, FULL = 1.9, 15.0  # of thrust over throttle [1, N]
CHARGES = (1.0, 0.97, 1.04)  # thrust over throttle in each flight, as the battery is [1]
SHORT = {"noise": 1.0, "seconds": 10.0, "attitude_noise": 0.003}


def with_throttle(log, charge):
    """Return the log with the throttle of its rotors in the place of its command."""
    f = np.maximum(log.u @ VEHICLE.unmixer.T, 0.0)
    unknown = np.full_like(log.u, np.nan)
    return dc.replace(
        log, u=unknown, throttle=(f / (charge * FULL)) ** (1 / EXPONENT), input="normalised"
    )


@pytest.fixture(scope="module")
def answer(fly):
    """Return a function that diagnoses two flights and a held-out one under an effect, which may
    begin in flight.
    """

    def diagnosed(effect, onsets=(None, None, None)):
        flights = [
            with_throttle(
                fly(
                    effect,
                    name=n,
                    seed=i,
                    onset={} if t is None else {effect.identifier: t},
                    **SHORT,
                ),
                c,
            )
            for i, (n, t, c) in enumerate(zip("abc", onsets, CHARGES, strict=True), start=1)
        ]
        return diagnose(VEHICLE, flights[:2], flights[2:])

    return diagnosed


def test_a_payload_is_told_by_its_swing_and_closes_the_held_out_gap(answer):
    dut = answer(SuspendedPayload(0.4, 1.1, hook_z=-0.02))
    assert dut.verdict == ("suspended_payload",)
    for name, truth in (("mass", 0.4), ("length", 1.1)):
        low, high = dut.causes[0].parameters[name].ci95
        assert low < truth < high
        assert high - low < 0.2 * truth
    assert dut.gap_reduction.fraction > 0.9
    (curve,) = (d for d in dut.calibration if d.name == "throttle_curve.curve")
    assert curve.text.startswith("thrust goes with the power 1.")
    assert curve.ci95[0] < EXPONENT - 1.5 < curve.ci95[1]


def test_a_mass_that_is_taken_up_in_flight_is_named_with_its_time(answer):
    dut = answer(MassError(0.4), (4.0, 6.0, 5.0))
    assert dut.verdict == ("mass_error",)
    (cause,) = dut.causes
    assert [cause.onset[n] for n in "abc"] == pytest.approx([4.0, 6.0, 5.0], abs=0.1)
    assert cause.parameters["delta_mass"].value == pytest.approx(0.4, rel=0.1)
    assert dut.gap_reduction.fraction > 0.9


def test_a_mass_that_was_always_there_is_that_of_the_map(answer):
    dut = answer(MassError(0.4))
    assert "mass_error" not in dut.verdict
