"""Laws of sums over regressors that begin in flight."""

import dataclasses as dc

import numpy as np
import pytest

from np_drake.diagnosis.forward_model import Term, predicted_residual
from np_drake.diagnosis.held_out import adapt
from np_drake.diagnosis.options import Options
from np_drake.diagnosis.regressors import SwitchedRegressors, SwitchedSums
from np_drake.effects.center_of_mass_offset import CenterOfMassOffset
from np_drake.effects.command_delay import CommandDelay
from np_drake.effects.linear_drag import LinearDrag
from np_drake.effects.mass_error import MassError
from np_drake.effects.motor_lag import MotorLag
from np_drake.effects.weak_rotor import WeakRotor

REAL, IDEAL = Options.for_sensors(True), Options.for_sensors(False)

SCALE = 0.7


@pytest.mark.parametrize("loud", [False, True], ids=["alike", "a flight louder than the model"])
@pytest.mark.parametrize(
    "effects",
    [[MassError(0.2)], [LinearDrag(0.3, 0.3, 0.3), WeakRotor(1, 0.9)]],
    ids=["one", "two"],
)
@pytest.mark.parametrize("equally", [False, True], ids=["any rows", "rows equally far apart"])
@pytest.mark.parametrize("accelerations", [True, False])
def test_sums_are_those_of_the_whitened_columns_from_each_row_on(
    seen, noise, effects, loud, equally, accelerations
):
    flight = seen(name="1", seed=1, noise=1.0, seconds=6.0, accelerations=accelerations)
    noise = dc.replace(noise, loudness={"1": np.linspace(0.5, 2.0, 15)}) if loud else noise
    X = np.stack([predicted_residual(flight, [Term(effect)]) for effect in effects], axis=-1)
    B = predicted_residual(flight, [Term(CenterOfMassOffset(0.01, 0.0, 0.0))])[..., None]
    dut = SwitchedRegressors(flight, noise, flight.y, B, SCALE)
    whole = dut.whole(X)
    rows = np.arange(40, 100, 20) if equally else np.array([3, 150, len(dut.t) - 4])
    found = dut.begun(X, whole, rows)
    y, beside = (SCALE * flight.white(noise, part) for part in (flight.y, B))
    both = np.concatenate([beside, y[..., None]], axis=-1)
    np.testing.assert_allclose(
        dut.products, np.tensordot(both, both, axes=([0, 1], [0, 1])), rtol=1e-9
    )
    for i, row in enumerate(rows):
        late = SCALE * flight.white(noise, X * flight.begun(dut.t[row])[..., None])
        for sums, other in zip(found, (late, beside, y), strict=True):
            expected = np.tensordot(late, other, axes=([0, 1], [0, 1]))
            np.testing.assert_allclose(
                sums[i], expected, rtol=1e-6, atol=1e-6 * np.abs(expected).max()
            )
    always = SCALE * flight.white(noise, X)
    expected = np.tensordot(always, always, axes=([0, 1], [0, 1]))
    np.testing.assert_allclose(whole[0][0], expected, rtol=1e-9)


def test_what_leaves_no_trace_has_no_sums_and_begins_nowhere(seen, noise):
    flight = seen(name="1", seed=1, noise=1.0, seconds=6.0)
    dut = SwitchedRegressors(flight, noise, flight.y, np.zeros((*flight.y.shape, 0)))
    nothing = np.zeros((*flight.y.shape, 2))
    assert not any(
        part.any() for part in dut.begun(nothing, dut.whole(nothing), np.array([40, 150]))
    )
    for effect in (MotorLag(0.0), CommandDelay(0.0)):
        (term,) = adapt([Term(effect)], flight, noise, priors=REAL.priors)
        assert term.begins("1") is None


def test_the_sums_of_a_candidate_are_made_once_for_the_same_rows(seen, noise, monkeypatch):
    flight = seen(name="1", seed=1, noise=1.0, seconds=6.0)
    columns = SwitchedRegressors(flight, noise, flight.y, np.zeros((*flight.y.shape, 0)))
    X = predicted_residual(flight, [Term(MassError(0.2))])[..., None]
    made = []
    begun = columns.begun
    monkeypatch.setattr(columns, "begun", lambda *of: made.append(1) or begun(*of))
    dut = SwitchedSums(columns, X)
    some, other = np.array([40, 150]), np.array([40, 151])
    assert dut.begun(some) is dut.begun(some.copy())
    for rows in (some, other):
        for part, expected in zip(dut.begun(rows), begun(X, dut.whole, rows), strict=True):
            np.testing.assert_array_equal(part, expected)
    assert len(made) == 2
