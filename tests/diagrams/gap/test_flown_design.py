"""Laws of a design that is flown in the simulator: limits kept, the truth named, the file flown again."""

import dataclasses as dc

import numpy as np
import pytest

from diagrams.gap.flown_design import (
    FILE,
    Flown,
    InSimulator,
    flown_usage,
    fly_under,
    keep_limits,
    scenario_of,
)
from diagrams.loop.flight import default_flight
from np_drake.diagnosis.numerics import NoiseModel, Readings
from np_drake.diagnosis.tolerance import IDEAL_SENSORS
from np_drake.effects.explanation import Explanation
from np_drake.effects.linear_drag import LinearDrag
from np_drake.effects.suspended_payload import SuspendedPayload
from np_drake.flight_design.design import FlightDesigner
from np_drake.flight_design.limits import limits_for
from np_drake.flight_design.naive import naive_motions
from np_drake.references.base import Hover
from np_drake.references.track_file import write_trajectory
from np_drake.vehicle import Vehicle
from systems.payload_config import PayloadConfig

SECONDS = 5.0
RMS = np.repeat([0.5, 0.05, 0.05, 0.2, 0.05], 3)
READINGS = Readings(NoiseModel(np.zeros((15, 1)), np.diag(1 / RMS), RMS, RMS**2, 0.02), IDEAL_SENSORS)
NOTHING = Explanation((), 0.5, ())
DRAG = Explanation(("linear_drag",), 0.5, (LinearDrag(0.5, 0.5, 0.5),))
HUNG = Explanation(("suspended_payload",), 0.5, (SuspendedPayload(0.2, 0.6, 0, 0, -0.05, 0.1),))


def designer_of(*explanations: Explanation, tilt: float = 0.5) -> FlightDesigner:
    limits = limits_for(Vehicle(), explanations, box=(4.0, 4.0, 2.5), speed=3.0, tilt=tilt)
    return FlightDesigner(explanations, READINGS, limits, SECONDS)


@pytest.fixture(scope="module")
def config():
    base = default_flight(Vehicle())
    reality = dc.replace(
        base.reality,
        payload=PayloadConfig(tether="none"),
        rotor_drag=0.0,
        motor_lag=0.0,
        thrust_scale=1.0,
    )
    controller = dc.replace(base.controller, kind="hold", solver="sqp")
    return dc.replace(base, name="next", reality=reality, controller=controller)


@pytest.fixture(scope="module")
def lemniscate():
    """Return a designer of drag against nothing, and a lemniscate as its candidate."""
    designer = designer_of(NOTHING, DRAG)
    motion = naive_motions(designer.limits, designer.basis, 0.7, 0)["lemniscate"]
    return designer, designer.candidate("lemniscate", motion)


@pytest.fixture(scope="module")
def flown(config, lemniscate, tmp_path_factory):
    designer, candidate = lemniscate
    folder = tmp_path_factory.mktemp("flown")
    in_simulator = InSimulator(config, designer, folder)
    return keep_limits(candidate, designer, in_simulator, controller="hold"), folder


def test_every_flight_keeps_the_limits(flown):
    (_, flights), folder = flown
    assert [f.explanation.label for f in flights] == ["nothing", "linear_drag"]
    assert all(0.3 < f.worst <= 1.0 for f in flights)
    assert (folder / FILE).is_file()


def test_each_log_names_what_acted(flown):
    (_, flights), _ = flown
    for k, f in enumerate(flights):
        assert f.posterior[k] > 0.99


def test_usage_of_a_flight_is_near_that_of_its_plan(flown, lemniscate):
    (candidate, flights), _ = flown
    assert candidate is lemniscate[1]
    for name in ("room", "speed", "tilt"):
        assert flights[0].usage[name] == pytest.approx(candidate.usage[name], abs=0.1)


def test_a_motion_beyond_a_limit_is_shrunk(config, lemniscate, tmp_path):
    designer, candidate = lemniscate
    tight = dc.replace(
        designer, explanations=(DRAG,), limits=dc.replace(designer.limits, tilt=0.9 * 0.7 * 0.5)
    )
    in_simulator = InSimulator(config, tight, tmp_path)
    wide = tight.candidate("l", candidate.reference)
    smaller, flights = keep_limits(wide, tight, in_simulator, controller="hold")
    assert smaller.usage["room"] < candidate.usage["room"]
    assert flights[0].worst <= 1.0


def test_a_vehicle_that_is_lost_is_told(lemniscate):
    designer, candidate = lemniscate
    with pytest.raises(ValueError, match="controller hold: gone under linear_drag"):
        keep_limits(candidate, designer, lambda *a: Flown(DRAG, {}, np.zeros(2), "gone"), controller="hold")


def test_the_swing_of_a_payload_is_looked_at(config, tmp_path):
    designer = designer_of(HUNG)
    motion = naive_motions(designer.limits, designer.basis, 0.5, 0)["doublets"]
    write_trajectory(motion, tmp_path / FILE, duration=SECONDS)
    found = fly_under(config, HUNG, designer, tmp_path / FILE, 0)
    assert 0.05 < found.usage["swing"] < 1.0
    assert found.flight is not None
    assert flown_usage(found.flight, designer.limits) == found.usage


def test_the_scenario_has_the_effects_of_the_explanation(config, tmp_path):
    hover = Hover(designer_of(DRAG).limits.center)
    write_trajectory(hover, tmp_path / FILE, duration=SECONDS)
    dut = scenario_of(config, DRAG, tmp_path / FILE, SECONDS)
    assert [e.effect for e in dut.reality.effects] == ["linear_drag"]
    assert dut.controller.kind == "hold"
    assert dut.end == pytest.approx(SECONDS)
