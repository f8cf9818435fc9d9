"""Laws of the parts of a log: what flies and what fits."""

import dataclasses as dc

import numpy as np
import pytest

from np_drake.logs.errors import LogError
from np_drake.logs.importing.conventions import Verdict
from np_drake.logs.importing.log_map import LogMap, Source
from np_drake.logs.importing.parts import import_part, require_ranges, standing
from np_drake.logs.importing.signals import Signal
from tests.np_drake.logs.importing import autopilot_streams as autopilots

T = 0.01 * np.arange(3000)


def hop(t: np.ndarray) -> np.ndarray:
    """A flight from the ground and back within 10 s, (n, 3)."""
    return np.stack([np.sin(np.pi * t / 10) ** 2, 0 * t, np.sin(np.pi * t / 10) ** 2], axis=1)


def flights_with_a_pause(idle: float) -> tuple[np.ndarray, np.ndarray]:
    """Two flights of 10 s with 10 s on the ground between them."""
    stands = (T >= 10) & (T < 20)
    return np.where(stands[:, None], 0.0, hop(T)), np.where(stands, idle, 1.0)


@pytest.mark.parametrize("idle", [0.0, 0.2])
def test_a_vehicle_stands_between_landing_and_the_next_take_off(idle):
    p, lift = flights_with_a_pause(idle)
    dut = standing(T, p, lift)
    assert dut[(T >= 10) & (T < 20)].all()
    assert not dut[
        np.linalg.norm(p, axis=1) > 0.06
    ].any()  # [m], the margin of the law and a little


def test_a_vehicle_that_dropped_a_load_of_more_than_its_weight_flies_on():
    assert not standing(T, hop(T), np.where(T > 12, 0.45, 1.0)).any()


def test_a_short_cut_of_thrust_and_a_fall_are_flight():
    p, _ = flights_with_a_pause(0.0)
    assert not standing(T, p, np.where((T > 10) & (T < 10.9), 0.0, 1.0)).any()
    fall = np.where(T > 10, -0.5 * 9.81 * (T - 10) ** 2, 0.0)
    assert not standing(T, np.stack([0 * T, 0 * T, fall], axis=1), np.where(T > 10, 0.0, 1.0)).any()


def test_a_part_whose_rotors_give_a_fraction_of_another_part_stands():
    rest = np.zeros((3000, 3))
    assert not standing(T, rest, np.full(3000, 0.3)).any()
    assert standing(T, rest, np.full(3000, 0.3), usual=1.0).all()


HOVER = np.linspace(0.3, 0.8, 100)[:, None]


@pytest.mark.parametrize(
    ("name", "factor", "message"),
    [
        ("throttle", 1000.0, "above 1.5 in flight.*percent, us, pwm16"),
        ("throttle", 100.0, "above 1.5 in flight"),
        ("throttle", -1.0, "below -0.05 in flight.*scale"),
        ("hover_throttle", 0.0, "below 0.02 in flight"),
        ("hover_throttle", 100.0, "above 1.5 in flight"),
        ("voltage", 1e4, "above 1000 in flight.*mV"),
        ("rotor_speed", 2e4, "above 5000 in flight.*rpm"),
    ],
)
def test_an_input_in_another_unit_is_refused(name, factor, message):
    log_map = LogMap(**{name: Source(["c"])})
    require_ranges(
        {name: HOVER * {"rotor_speed": 1e3, "voltage": 16}.get(name, 1)}, log_map, "flight.csv"
    )
    with pytest.raises(LogError, match=rf"flight.csv, {name} \(c\): must not be {message}"):
        require_ranges({name: HOVER * factor}, log_map, "flight.csv")


def tumbling(streams, at: float):
    """Return PX4's messages of a vehicle that hits something at `at` [s]: its sensors go wild."""
    rng = np.random.default_rng(0)

    def wild(stream, size):
        noise = size * (stream.t > at) * rng.standard_normal(len(stream))
        return dc.replace(stream, columns={c: v + noise for c, v in stream.columns.items()})

    sizes = {"vehicle_angular_velocity": 15.0, "sensor_combined": 60.0}
    return {name: wild(s, sizes[name]) if name in sizes else s for name, s in streams.items()}


def test_a_log_that_ends_in_a_crash_is_imported_up_to_it(flown, import_px4):
    found = import_px4(
        {"actuator_motors": autopilots.throttle(flown)}, change=lambda s: tumbling(s, 6.0)
    )
    (dut,) = found.flights
    assert 4.0 < dut.t[-1] < 5.1  # the log begins at 1 s
    assert any(line.startswith(f"fits until {dut.t[-1]:.1f} s; beyond, ") for line in found.shown)
    assert np.abs(dut.w).max() < 10.0


def test_start_and_stop_of_a_call_count_from_the_log_s_own_start(flown, import_px4):
    outputs = {"actuator_motors": autopilots.throttle(flown)}
    (dut,) = import_px4(outputs, start=1.5, stop=4.0).flights
    np.testing.assert_allclose(dut.p, flown.p[150:401], atol=1e-9)
    with pytest.raises(LogError, match="start and stop must leave samples; position has 0 in them"):
        import_px4(outputs, start=50.0)


SIZES = {"position": 3, "velocity": 3, "attitude": 4, "rates": 3, "thrust": 1}


def calm_then_turning(rate: float, lost: float) -> dict[str, Signal]:
    """Return signals of 20 s, a turn from 10 s on; position and velocity come at a rate [Hz] and
    lack those of 0.3 s.
    """
    fast, slow = 0.003 + 0.01 * np.arange(2000), np.arange(0.0, 20.0, 1.0 / rate)
    slow = slow[(slow < lost) | (slow > lost + 0.3)]
    turn = 2.0 * np.clip(slow - 10.0, 0.0, None)
    v = 0.1 * np.cos(2 * slow) + 2 * np.sin(turn)
    p = 0.05 * np.sin(2 * slow) + 1 - np.cos(turn)
    values = {
        "position": np.stack([p, 0 * slow, 0 * slow + 1], axis=1),
        "velocity": np.stack([v, 0 * slow, 0 * slow], axis=1),
        "attitude": np.tile([1.0, 0, 0, 0], (2000, 1)),
        "rates": np.zeros((2000, 3)),
        "thrust": np.full((2000, 1), 20.0),
    }
    return {name: Signal(slow if len(x) < 2000 else fast, x) for name, x in values.items()}


@pytest.mark.parametrize(
    ("rate", "lost", "flights"),
    [
        (10.0, 4.05, 1),  # three samples of calm flight
        (10.0, 14.05, 2),  # of a turn
        (100.0, 4.05, 2),  # thirty samples
    ],
)
def test_a_gap_is_judged_by_rate_and_motion_and_marked_in_one_flight(rate, lost, flights):
    log_map = LogMap(**{name: Source([name] * size) for name, size in SIZES.items()})
    dut = import_part(calm_then_turning(rate, lost), log_map, Verdict({}, ()), "log").flights
    assert len(dut) == flights
    for log in dut:
        t = log.start + log.t
        edge = 0.05 if rate == 10.0 else 0.0
        inside = (t > lost - edge) & (t < lost + 0.3 + edge)
        assert inside.sum() == (40 if flights == 1 else 0)
        np.testing.assert_array_equal(log.in_gap, inside)
