import dataclasses as dc

import numpy as np
import pytest

from np_drake import attitude
from np_drake.identification.identify import Identification, identify

TRUTH = {  # name: (value, tolerance of it), beside which the interval must hold the value nearly
    "thrust coefficient": (9e-6, 3e-8),
    "inertia xx": (0.011, 1e-4),
    "inertia yy": (0.013, 1e-4),
    "inertia zz": (0.02, 6e-4),
    "inertia xy": (-0.0002, 5e-5),
    "inertia xz": (0.0001, 1e-4),
    "inertia yz": (0.00015, 1e-4),
    "centre of mass x": (0.003, 2e-4),
    "centre of mass y": (-0.002, 2e-4),
    "gain of rotor 1": (1.01, 5e-3),
    "gain of rotor 4": (0.985, 5e-3),
    "torque over thrust": (1.9e-7 / 9e-6, 6e-4),
    "inertia of a rotor": (4e-6, 2e-7),
    "time constant up": (0.03, 1e-3),
    "time constant down": (0.04, 1e-3),
    "transport delay": (0.008, 1e-3),
    "thrust at full throttle": (10.0, 0.1),
    "IMU x": (0.01, 5e-4),
    "IMU y": (-0.012, 5e-4),
    "IMU z": (0.008, 5e-4),
    "IMU tilt x": (0.004, 4e-3),
    "IMU tilt y": (-0.003, 4e-3),
    "drag, lateral": (0.1, 0.01),
}
RATIOS = {
    "thrust coefficient",
    "inertia xx",
    "inertia yy",
    "inertia zz",
    "inertia xy",
    "inertia of a rotor",
}


@pytest.fixture(scope="module")
def again(analytic):
    """Identify from logs with the mass, on the shortest flights."""

    def run(*logs, **options) -> Identification:
        return identify(
            logs,
            options.pop("prior", analytic.KNOWN),
            mass=options.pop("mass", analytic.TRUE.mass),
            **options,
        )

    return run


@pytest.fixture(scope="module")
def short(analytic):
    return analytic.flight(seed=7, seconds=5.0)


@pytest.fixture(scope="module")
def alone(again, short):
    return again(short)


def same(one: Identification, two: Identification, share: float = 0.02) -> None:
    """Check that two identifications tell the same, within a share of their intervals."""
    assert [q.name for q in one.quantities] == [q.name for q in two.quantities]
    for a, b in zip(one.quantities, two.quantities, strict=True):
        assert abs(a.value - b.value) <= share * (a.high - a.low), a.name
        assert (b.high - b.low) == pytest.approx(a.high - a.low, rel=5 * share), a.name


@pytest.mark.parametrize("kind", ["found", "by_throttle"])
def test_a_flight_in_closed_form_tells_its_vehicle(kind, request):
    dut = request.getfixturevalue(kind)
    for name in TRUTH.keys() & {q.name for q in dut.quantities}:
        value, tolerance = TRUTH[name]
        assert dut[name].value == pytest.approx(value, abs=tolerance), name
        assert dut[name].low - tolerance < value < dut[name].high + tolerance


def test_all_but_the_hardest_is_told(found):
    untold = {q.name for q in found.quantities if not q.told}
    assert untold <= {"IMU tilt z", "IMU tilt x", "IMU tilt y"}


def test_the_order_of_flights_does_not_matter(analytic, found, flights, again):
    same(found, again(*flights[::-1]))


def test_neither_heading_nor_place_of_the_world_matter(alone, again, short):
    turn = attitude.from_rotation_vector(np.array([[0.0, 0.0, 1.9]]))
    turned = {
        f: attitude.rotate(np.broadcast_to(turn, short.q.shape), getattr(short, f)) for f in "pva"
    }
    turned["p"] = turned["p"] + [50.0, -20.0, 7.0]
    same(alone, again(dc.replace(short, q=attitude.multiply(turn, short.q), **turned)), 1e-4)


def test_time_may_begin_anywhere(alone, again, short):
    same(alone, again(dc.replace(short, t=short.t + 1000.0)), 0.02)


def test_the_unit_of_rotor_speed_scales_the_coefficient_alone(alone, again, short):
    other = again(dc.replace(short, rotor=short.rotor * 10.0))
    assert other["thrust coefficient"].value == pytest.approx(
        alone["thrust coefficient"].value / 100.0, rel=1e-3
    )
    for name in ("inertia xx", "inertia zz", "centre of mass x", "torque over thrust", "IMU x"):
        assert other[name].value == pytest.approx(
            alone[name].value, abs=0.1 * (alone[name].high - alone[name].low)
        )


def test_twice_the_mass_doubles_inertia_and_thrust_and_no_ratio(analytic, alone, again, short):
    double = again(short, mass=2 * analytic.TRUE.mass)
    for q in alone.quantities:
        factor = 2.0 if q.quantity.per_mass else 1.0
        assert double[q.name].value == pytest.approx(factor * q.value, rel=1e-6), q.name


def test_without_mass_quantities_are_over_the_mass(analytic, alone, again, short):
    ratios = again(short, mass=None)
    assert ratios.basis.ratios
    assert ratios["inertia xx"].value == pytest.approx(
        alone["inertia xx"].value / analytic.TRUE.mass, rel=1e-6
    )


def test_a_trusted_coefficient_tells_the_mass(analytic, again, short):
    right = dc.replace(analytic.KNOWN, thrust_coefficient=9e-6)
    dut = again(short, mass=None, prior=right, trusted=True)
    assert not dut.basis.ratios
    assert dut["mass"].value == pytest.approx(1.3, rel=0.01)
    assert dut["mass"].low < dut["mass"].value < dut["mass"].high


def test_trusted_newtons_tell_the_mass(analytic, again):
    dut = again(analytic.flight(seed=2, seconds=5.0, drive="command"), mass=None, trusted=True)
    assert dut["mass"].value == pytest.approx(1.3, rel=0.01)


def test_faults_in_the_telemetry_of_a_rotor_change_nothing(alone, again, short):
    rotor = short.rotor.copy()
    rotor[[100, 250, 400], [0, 1, 3]] = [0.0, 4000.0, 9e4]
    same(alone, again(dc.replace(short, rotor=rotor)), 0.35)


def test_more_flights_narrow_the_intervals(alone, found):
    narrower = [q.within / alone[q.name].within for q in found.quantities if q.quantity.field]
    assert np.median(narrower) < 0.7


def test_hover_tells_thrust_and_not_inertia(analytic, again):
    dut = again(analytic.flight(seed=1, seconds=5.0, size=0.0))
    assert dut["thrust coefficient"].told
    assert dut["thrust coefficient"].value == pytest.approx(9e-6, rel=0.05)
    for name in ("inertia xx", "inertia yy", "inertia zz", "IMU x"):
        assert not dut[name].told, name
        assert dut[name].quantity.why
        assert dut[name].quantity.manoeuvre


def test_no_quantity_is_less_sure_than_its_prior(analytic, alone, found, again):
    hover = again(analytic.flight(seed=1, seconds=5.0, size=0.0))
    for dut in (alone, found, hover):
        # Products of inertia go with the moments, which differ from those of the prior.
        for q in (
            q for q in dut.quantities if not q.quantity.unit.startswith("kg") or q.quantity.positive
        ):
            prior = (
                np.log(q.prior[1] / q.prior[0]) if q.quantity.positive else q.prior[1] - q.prior[0]
            )
            width = np.log(q.high / q.low) if q.quantity.positive else q.high - q.low
            assert width < 1.3 * prior, q.name


def test_without_velocity_nothing_is_told_of_the_air(alone, again, short):
    dut = again(dc.replace(short, lacks=("height", "velocity"), v=0 * short.v, p=0 * short.p))
    assert not any("drag" in q.name or "lateral speed" in q.name for q in dut.quantities)
    assert dut["inertia xx"].value == pytest.approx(0.011, rel=0.02)


def test_without_accelerometer_the_velocity_tells_thrust(again, short):
    dut = again(dc.replace(short, a=None))
    assert not any("IMU" in q.name for q in dut.quantities)
    assert dut["thrust coefficient"].value == pytest.approx(9e-6, rel=0.01)
    assert dut["inertia xx"].value == pytest.approx(0.011, rel=0.02)


def test_flights_that_differ_in_inertia_disagree_on_it_alone_and_widen_it(
    analytic, found, flights, again
):
    heavier = np.array(analytic.TRUE.inertia) * np.array([[1.1, 1, 1], [1, 1, 1], [1, 1, 1]])
    other = analytic.flight(dc.replace(analytic.TRUE, inertia=heavier.tolist()), 2, seconds=10.0)
    dut = again(*flights[:2], other)
    assert dut["inertia xx"].p < 0.01
    assert dut["inertia xx"].within > 5 * found["inertia xx"].within
    assert dut["inertia xx"].low < 0.0121
    assert dut["inertia xx"].high > 0.011
    assert dut["IMU x"].p > 0.01
    assert dut["thrust coefficient"].p > 0.01


def test_flights_of_one_vehicle_agree(found):
    ps = [q.p for q in found.quantities if np.isfinite(q.p) and q.quantity.field]
    assert len(ps) > 10
    assert min(ps) > 0.001


def test_short_logs_are_left_out_with_a_note(again, short):
    dut = again(short, short.rows(0, 200))
    assert len(dut.models) == 1
    assert "shorter than 3 s" in dut.notes[0]
    with pytest.raises(ValueError, match="needs a flight of 3 s"):
        again(short.rows(0, 200))


def test_a_flight_just_long_enough_is_identified(again, short):
    assert again(short.rows(0, 310))["thrust coefficient"].told


@pytest.mark.parametrize("kind", ["desk", "thrown"])
def test_a_log_that_does_not_fly_is_refused_in_a_line(again, short, kind):
    rest = (
        dc.replace(short, rotor=0 * short.rotor)
        if kind == "desk"
        else dc.replace(short, a=short.a * 0 - [0, 0, 9.81])
    )
    with pytest.raises(ValueError, match=r"identify: .*flight7") as told:
        again(rest)
    assert "\n" not in str(told.value)


@pytest.mark.parametrize("idle", [0.0, 0.05])
@pytest.mark.parametrize("drive", ["rotor_speed", "throttle"])
def test_a_long_stand_before_the_flight_changes_nothing(analytic, again, drive, idle):
    log = analytic.flight(seed=7, seconds=5.0, drive=drive)
    rows, rng = 700, np.random.default_rng(0)

    def after(values: np.ndarray | None, before: float, noise: float = 0.0) -> np.ndarray | None:
        """Return values that a stand goes before."""
        if values is None:
            return None
        stand = before + noise * rng.normal(size=(rows, values.shape[1]))
        return np.concatenate([stand, values])

    dut = again(
        dc.replace(
            log,
            t=np.arange(rows + len(log)) * 0.01,
            q=np.concatenate([np.repeat(log.q[:1], rows, axis=0), log.q]),
            **{f: after(getattr(log, f), 0.0) for f in "pvu"},
            w=after(log.w, 0.0, 0.002),
            a=after(log.a, 0.0, 0.03),
            rotor=after(log.rotor, 600.0 * idle),
            throttle=after(log.throttle, idle),
        )
    )
    assert dut["inertia xx"].value == pytest.approx(0.011, rel=0.02)
    assert dut["inertia xx"].high < 1.1 * dut["inertia xx"].low
    assert 0.3 < dut.models[0].flight.good.mean() < 0.45


def test_a_log_at_rest_among_flights_is_left_out_with_a_note(again, short, alone):
    rest = dc.replace(short, rotor=0 * short.rotor, name="desk")
    dut = again(short, rest)
    assert "desk" in dut.notes[0]
    same(alone, dut)


def test_flights_that_differ_in_what_they_hold_are_refused(again, short):
    with pytest.raises(ValueError, match=r"flight7: .*rotor speed"):
        again(short, dc.replace(short, rotor=None))


def test_telemetry_of_throttle_in_one_flight_alone_is_left_out(analytic, again, short, alone):
    both = analytic.flight(seed=7, seconds=5.0, drive="both")
    dut = again(both, short)
    assert all(model.channels == 6 for model in dut.models)


@pytest.mark.parametrize("drive", ["rotor_speed", "throttle", "command"])
def test_constant_readings_without_noise_tell_thrust_alone(again, short, drive):
    rows = len(short)
    still = dc.replace(
        short,
        w=0 * short.w,
        q=np.tile([1.0, 0.0, 0.0, 0.0], (rows, 1)),
        v=0 * short.v,
        a=0 * short.a,
    )
    inputs = {
        "rotor_speed": {"rotor": np.full((rows, 4), 595.0)},
        "throttle": {"throttle": np.full((rows, 4), 0.4), "rotor": None},
        "command": {
            "u": np.tile([1.3 * 9.81, 0.0, 0.0, 0.0], (rows, 1)),
            "rotor": None,
            "input": "command",
        },
    }
    dut = again(dc.replace(still, **inputs[drive]))
    assert all(np.isfinite([q.value, q.low, q.high]).all() for q in dut.quantities)
    assert not dut["inertia xx"].told


@pytest.mark.parametrize("rate", [50.0, 400.0])
def test_slow_and_fast_logs_tell_the_same(analytic, again, rate):
    dut = again(analytic.flight(seed=7, seconds=5.0, rate=rate))
    assert dut["inertia xx"].value == pytest.approx(0.011, rel=0.03)
    assert dut["thrust coefficient"].value == pytest.approx(9e-6, rel=0.01)
