"""Laws of a flight that is flown in the simulator first: limits kept, the truth named."""

import dataclasses as dc

import numpy as np
import pytest

from diagrams.gap.limits_check import Flown, InSimulator, keep_limits, scenario_of
from diagrams.gap.next_flight import TRACK, DiagnosisReport
from diagrams.loop.flight import default_flight
from np_drake.diagnosis.numerics import NoiseModel, Readings
from np_drake.diagnosis.options import IDEAL_SENSORS
from np_drake.effects.explanation import Explanation
from np_drake.effects.linear_drag import LinearDrag
from np_drake.effects.suspended_payload import SuspendedPayload
from np_drake.flight_design.limits import limits_for
from np_drake.flight_design.multisine import random_multisine
from np_drake.references.base import Hover
from np_drake.references.track_file import write_trajectory
from np_drake.vehicle import Vehicle
from systems.payload_config import PayloadConfig

SECONDS = 5.0
RMS = np.repeat([0.5, 0.05, 0.05, 0.2, 0.05], 3)
READINGS = Readings(
    NoiseModel(np.zeros((15, 1)), np.diag(1 / RMS), RMS, RMS**2, 0.02), IDEAL_SENSORS
)
NOTHING = Explanation((), 0.5, ())
DRAG = Explanation(("linear_drag",), 0.5, (LinearDrag(0.5, 0.5, 0.5),))
HUNG = Explanation(("suspended_payload",), 0.5, (SuspendedPayload(0.2, 0.6, 0, 0, -0.05, 0.1),))


def limits_of(*explanations: Explanation):
    return limits_for(Vehicle(), explanations, box=(4.0, 4.0, 2.5), speed=3.0, tilt=0.5)


@pytest.fixture(scope="module")
def config():
    base = default_flight(Vehicle())
    bare = {
        "payload": PayloadConfig(tether="none"),
        "rotor_drag": 0.0,
        "motor_lag": 0.0,
        "thrust_scale": 1.0,
    }
    controller = dc.replace(base.controller, kind="hold", solver="sqp")
    return dc.replace(
        base, name="next", reality=dc.replace(base.reality, **bare), controller=controller
    )


def simulator_of(config, folder, *explanations: Explanation) -> InSimulator:
    report = DiagnosisReport(folder, config, explanations, READINGS)
    return InSimulator(config, report, limits_of(*explanations), folder)


@pytest.fixture(scope="module")
def flown(config, tmp_path_factory):
    """Return a multisine, and its flights under nothing and under drag."""
    dut = simulator_of(config, tmp_path_factory.mktemp("flown"), NOTHING, DRAG)
    motion = random_multisine(dut.limits, SECONDS, seed=0)
    return (
        motion,
        dut,
        keep_limits(motion, (NOTHING, DRAG), dut, controller="hold", limits=dut.limits),
    )


def test_every_flight_keeps_the_limits_and_its_log_names_what_acted(flown):
    _, dut, (_, flights) = flown
    assert [f.explanation.label for f in flights] == ["nothing", "linear_drag"]
    for k, f in enumerate(flights):
        assert 0.3 < f.worst <= 1.0
        assert f.posterior[k] > 0.99
    assert (dut.folder / TRACK).is_file()


def test_usage_of_a_flight_is_near_that_of_its_plan(flown):
    _, dut, (motion, flights) = flown
    planned = motion.usage(dut.limits)
    for name in ("room", "speed", "tilt"):
        assert flights[0].usage[name] == pytest.approx(planned[name], abs=0.15)


def test_a_motion_beyond_a_limit_is_made_smaller(flown):
    motion, dut, _ = flown
    wide = motion.scaled(2.0)

    def fly_one(tried, explanation):
        return Flown(explanation, tried.usage(dut.limits), np.ones(1))

    smaller, flights = keep_limits(wide, (DRAG,), fly_one, controller="hold", limits=dut.limits)
    assert max(wide.usage(dut.limits).values()) > 1.0
    assert 0.5 < flights[0].worst <= 1.0
    assert smaller.usage(dut.limits)["room"] < wide.usage(dut.limits)["room"]


def refusal(motion, **flown) -> str:
    """Return what is said where a flight is beyond a limit however small it is."""
    many = dc.replace(
        DRAG, named=("linear_drag", "mass_error", "motor_lag", "thrust_scale", "weak_rotor")
    )
    with pytest.raises(ValueError) as error:
        keep_limits(
            motion,
            (many,),
            lambda *a: Flown(many, **flown),
            controller="hold",
            limits=limits_of(DRAG),
        )
    return str(error.value)


def test_a_vehicle_that_is_lost_is_told_under_three_effects_at_most(flown):
    said = refusal(flown[0], usage={}, posterior=np.zeros(1), lost="gone")
    assert "controller hold: gone under linear_drag, mass_error, motor_lag and 2 more. " in said
    assert said.endswith("Name another --controller, give --no-fly.")


@pytest.mark.parametrize(
    "limit, remedy",
    [
        ("room", ", or widen --box (now 4.00 4.00 2.50 m)."),
        ("speed", ", or widen --speed (now 3.00 m/s)."),
        ("tilt", ", or widen --tilt (now 0.500 rad)."),
        ("thrust", "."),
    ],
)
def test_a_refusal_names_the_limit_to_widen_and_its_value(flown, limit, remedy):
    said = refusal(flown[0], usage={limit: 2.0}, posterior=np.zeros(1))
    assert f"{limit} is 2.00 of its limit" in said
    assert said.endswith(f"Name another --controller{remedy}")


def test_the_swing_of_a_payload_is_looked_at(config, tmp_path):
    dut = simulator_of(config, tmp_path, HUNG)
    found = dut(random_multisine(dut.limits, SECONDS, seed=0, share=0.5), HUNG)
    assert 0.05 < found.usage["swing"] < 1.0


def test_the_scenario_has_the_effects_of_the_explanation(config, tmp_path):
    write_trajectory(Hover(limits_of(DRAG).center), tmp_path / TRACK, duration=SECONDS)
    dut = scenario_of(config, DRAG, tmp_path / TRACK, SECONDS)
    assert [e.effect for e in dut.reality.effects] == ["linear_drag"]
    assert dut.controller.kind == "hold"
    assert dut.end == pytest.approx(SECONDS)
