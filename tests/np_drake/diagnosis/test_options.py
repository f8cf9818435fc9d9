"""Laws of the options: what real and ideal sensors share, and that a diagnosis obeys those it is
given.
"""

import dataclasses as dc
import importlib

import pytest

from np_drake.diagnosis.diagnose import diagnose
from np_drake.diagnosis.options import IDEAL_SENSORS, Materiality, Options, Priors, Tolerance
from np_drake.effects.mass_error import MassError
from np_drake.vehicle import Vehicle

infer_module = importlib.import_module(
    "np_drake.diagnosis.decision.infer"
)  # the package has a function so named

REAL, IDEAL = Options.for_sensors(True), Options.for_sensors(False)


def test_options_hold_the_tolerance_of_their_sensors_or_ones_own():
    assert (REAL.tolerance, IDEAL.tolerance) == (Tolerance(), IDEAL_SENSORS)
    own = Tolerance(mass=0.02)
    assert Options.for_sensors(True, own) == dc.replace(REAL, tolerance=own)


def test_ideal_sensors_show_smaller_effects_and_leave_less_unexplained():
    assert IDEAL.materiality.force < REAL.materiality.force
    assert IDEAL.materiality.torque < REAL.materiality.torque
    for name in ("misfit_ratio", "slow_torque_ratio"):
        assert getattr(IDEAL.thresholds, name) < getattr(REAL.thresholds, name)
    assert IDEAL.thresholds.cause_probability > REAL.thresholds.cause_probability


def test_generic_structure_is_less_likely_than_an_effect():
    dut = Priors()
    assert dut.of_effect("linear_drag") == dut.effect
    assert dut.of_effect("unknown:place") == dut.of_effect("unknown") == dut.effect - dut.generic


def test_a_mass_that_is_immaterial_by_the_options_is_no_cause(fly, searched, monkeypatch):
    logs = [
        fly(MassError(0.2), name=n, seed=i, noise=1.0, seconds=6.0) for i, n in enumerate("abc", 1)
    ]
    blunt = dc.replace(
        IDEAL, materiality=Materiality(force=1.0, torque=100.0, position=10.0, remaining_force=1.0)
    )
    how = {"adaptive_split": False}
    monkeypatch.setattr(  # both search alike: once is enough
        infer_module,
        "find_map_model",
        lambda flights, given: dc.replace(searched(flights), options=given),
    )
    sharp = diagnose(Vehicle(), logs[:2], logs[2:], options=IDEAL, **how)
    assert sharp.verdict == ("mass_error",)
    assert diagnose(Vehicle(), logs[:2], logs[2:], options=blunt, **how).verdict == ()


def test_tolerance_and_options_together_are_refused():
    with pytest.raises(ValueError, match="either tolerance or options"):
        diagnose(Vehicle(), [], [], tolerance=Tolerance(), options=REAL)


def test_a_material_force_is_in_proportion_to_a_material_position_error():
    dut = REAL.with_material(0.1).materiality
    assert (dut.position, dut.remaining_force) == (
        0.1,
        pytest.approx(2 * REAL.materiality.remaining_force),
    )
    with pytest.raises(ValueError, match="material position error must be positive"):
        REAL.with_material(0.0)
