"""Laws of what changed since flights before."""

import dataclasses as dc
import importlib
import sys
from functools import cache
from pathlib import Path

import numpy as np
import pytest

import np_drake
from np_drake.diagnosis.diagnose import diagnose
from np_drake.diagnosis.options import Options, Tolerance
from np_drake.diagnosis.regressors import widen_tolerance
from np_drake.diagnosis.report.words import headline, lead
from np_drake.effects.center_of_mass_offset import CenterOfMassOffset
from np_drake.effects.linear_drag import LinearDrag
from np_drake.effects.mass_error import MassError
from np_drake.effects.suspended_payload import SuspendedPayload
from np_drake.effects.thrust_scale import ThrustScale
from np_drake.effects.torque_ratio import TorqueRatio
from np_drake.effects.weak_rotor import WeakRotor
from np_drake.vehicle import Vehicle
from np_drake.vehicle.vehicle import VOLTAGE

UNMEASURED = Vehicle(command_timing="unknown")
OWN = (LinearDrag(0.3, 0.3, 0.2), WeakRotor(2.0, 0.96))  # there before, and not in the file

pytestmark = pytest.mark.usefixtures("quick_searches")


@pytest.fixture(scope="module")
def since(fly):
    """Return a function that gives what changed by some effects since two flights; cached."""

    @cache
    def answer(*changes, cells=None, same_battery=False):
        def flown(*effects, name, seed, cells):
            own = {"noise": 1.0, "seconds": 10.0, "vehicle": UNMEASURED}
            log = fly(*OWN, *effects, name=name, seed=seed, **own)
            return by_throttle(log, cells) if cells else log

        how = {"tolerance": Tolerance(), "adaptive_split": False, "same_battery": same_battery}
        usual = cells and 1.0
        how["before"] = [flown(name=f"before {i}", seed=i, cells=usual) for i in (1, 2)]
        after = [flown(*changes, name=f"after {i}", seed=i, cells=cells) for i in (3, 4, 5)]
        return diagnose(after[:2], after[2:], UNMEASURED, **how)

    return answer


def test_a_flight_is_conditioned_once_and_its_rows_pass_few_files(fly, monkeypatch):
    names = ("before", "train", "held out")
    how = {"noise": 1.0, "seconds": 8.0, "vehicle": UNMEASURED}
    logs = [fly(*OWN, name=name, seed=i, **how) for i, name in enumerate(names)]
    conditioned, files = [], set()
    module = importlib.import_module("np_drake.diagnosis.diagnose")
    make = module.make_flight_residuals

    def counted(log, *given):
        conditioned.append(log.name)
        return make(log, *given)

    def enter(frame, event, _):
        if event == "call":
            files.add(Path(frame.f_code.co_filename))

    monkeypatch.setattr(module, "make_flight_residuals", counted)
    before = sys.getprofile()
    sys.setprofile(enter)
    try:
        diagnose([logs[1]], [logs[2]], UNMEASURED, before=[logs[0]], adaptive_split=False)
    finally:
        sys.setprofile(before)
    assert sorted(conditioned) == sorted(names)
    package = Path(np_drake.__file__).parent
    passed = [file.relative_to(package) for file in files if file.is_relative_to(package)]
    # Effects are the physics, a file each; of `compiled` numba loads machine code.
    assert 20 < len([f for f in passed if f.parts[0] not in ("effects", "compiled.py")]) <= 45


def test_what_was_there_before_has_not_changed(since):
    found = since()
    assert (found.verdict, found.before) == ((), ("before 1", "before 2"))
    assert found.headline.startswith("Nothing changed since the flights before that these flights")
    assert "of a rotor would" in found.headline
    assert "remains unexplained" in headline(dc.replace(found, verdict=("unknown",)))


@pytest.mark.parametrize(
    "change, parameter, says",
    [
        (MassError(0.12), "delta_mass", "mass +120 g"),
        (
            WeakRotor(4.0, 0.85),
            "efficiency",
            "rear left rotor (rotor 4 of the vehicle file): thrust −15 %",
        ),
        (SuspendedPayload(0.1, length=0.8), "mass", "a 100 g payload on 0.79"),
        (TorqueRatio(1.35), "ratio", "torque over thrust +3"),
    ],
)
def test_what_changed_is_named_with_its_size(since, change, parameter, says):
    found = since(change)
    assert found.verdict == (change.identifier,)
    (cause,) = (c for c in found.causes if c.changed)
    low, high = cause.parameters[parameter].ci95
    assert low < getattr(change, parameter) < high
    said = found.headline.replace("\xa0", " ")
    assert said.startswith(f"Changed since the flights before: {says}")
    assert all(name.startswith("after") for name in cause.onset)
    assert "there already before: linear drag" in lead(found)


def test_a_battery_that_moved_is_a_change_only_where_it_stayed_in_place(since):
    moved = CenterOfMassOffset(0.004, -0.003, 0.0)  # a fiftieth of the arm
    assert since(moved).verdict == ()
    assert since(moved, same_battery=True).verdict == ("center_of_mass_offset",)


@pytest.mark.parametrize(
    "given, less", [("command", 3.0), ("rotor_speed", 3.0), ("normalised", 0.0)]
)
def test_thrust_is_less_likely_to_change_than_one_part_but_over_throttle(seen, given, less):
    flight = seen(name="a", seed=1, seconds=4.0)
    log = dc.replace(flight.log, input=given)
    flights = [dc.replace(flight, log=log, earlier=earlier) for earlier in (True, False)]
    priors = widen_tolerance(Options.for_sensors(True), flights).priors
    assert priors.of_effect("mass_error") - priors.of_effect("thrust_scale") == less
    assert priors.of_effect("torque_ratio") == priors.of_effect("mass_error")


def by_throttle(log, cells):
    """Return the log with the throttle of each rotor, and a battery of more cells than usual."""
    volts = np.full(len(log), 3.8 * cells)
    thrust = np.maximum(log.u @ UNMEASURED.unmixer.T, 0.0)
    throttle = np.sqrt(thrust / 20.0 / cells**VOLTAGE)
    return dc.replace(log, throttle=throttle, voltage=volts, input="normalised")


@pytest.mark.parametrize(
    "change, cells, verdict", [((ThrustScale(1.25),), 1.0, ("thrust_scale",)), ((), 4 / 3, ())]
)
def test_stronger_rotors_are_named_by_throttle_and_another_battery_is_not(
    since, change, cells, verdict
):
    found = since(*change, cells=cells)
    assert found.verdict == verdict
    assert any(w.startswith("battery: 3.8") for w in found.warnings) == (cells != 1.0)
    if change:
        (cause,) = (c for c in found.causes if c.changed)
        assert cause.parameters["scale"].value == pytest.approx(1.25, abs=0.05)


def test_a_change_beyond_the_smallest_visible_is_named(since):
    least = since().visible["mass_error.delta_mass"]
    assert since(MassError(2.0 * least)).verdict == ("mass_error",)
    assert since(MassError(0.3 * least)).verdict == ()


def test_a_flight_before_that_is_short_or_one_of_those_after_is_refused(fly):
    a, b = fly(name="a", seconds=5.0), fly(name="b", seed=1, seconds=5.0)
    with pytest.raises(ValueError, match=r"d.* at least 3 s"):
        diagnose([a], [b], Vehicle(), before=[fly(name="d", seed=2, seconds=2.0)])
    with pytest.raises(ValueError, match="c is the same flight as d"):
        diagnose([a], [dc.replace(b, name="c")], Vehicle(), before=[dc.replace(b, name="d")])
