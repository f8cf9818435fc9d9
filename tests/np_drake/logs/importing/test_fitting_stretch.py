"""A log that ends in a crash is imported up to it, and the time is said."""

import dataclasses as dc

import numpy as np
import pytest

from np_drake.logs.errors import LogError
from np_drake.logs.formats.format import Stream
from np_drake.logs.importing.conventions import WrongConventions
from np_drake.logs.importing.parts import end_of_flight


def tumbling(streams, at: float, seed: int = 0):
    """Return PX4's messages of a vehicle that hits something at `at` [s]: sensors and estimate go
    wild.
    """
    rng = np.random.default_rng(seed)
    out = dict(streams)
    for name, size in (("vehicle_angular_velocity", 15.0), ("sensor_combined", 60.0)):
        stream = out[name]
        late = stream.t > at
        out[name] = dc.replace(
            stream,
            columns={
                c: np.where(late, size * rng.standard_normal(len(late)), v)
                for c, v in stream.columns.items()
            },
        )
    place = out["vehicle_local_position"]
    late = place.t > at
    wild = {
        c: np.where(late, v + 4.0 * np.sin(3 * (place.t - at)), v)
        for c, v in place.columns.items()
        if c[0] == "v"
    }
    out["vehicle_local_position"] = dc.replace(place, columns={**place.columns, **wild})
    return out


@pytest.mark.parametrize("at", [6.0])
def test_a_log_that_ends_in_a_crash_is_imported_up_to_it(flown, autopilots, import_px4, at):
    found = import_px4(
        {"actuator_motors": autopilots.throttle(flown)}, change=lambda s: tumbling(s, at)
    )
    (dut,) = found.flights
    assert at - 2.0 < dut.t[-1] < at - 1.0 + 0.1  # the log begins at 1 s
    assert any(line.startswith(f"fits until {dut.t[-1]:.1f} s; beyond, ") for line in found.said)
    assert np.abs(dut.w).max() < 10.0


def test_what_never_fits_is_refused_as_before(flown, autopilots, import_px4):
    with pytest.raises(WrongConventions, match="--start and --stop"):
        import_px4(
            {"actuator_motors": autopilots.throttle(flown)}, change=lambda s: tumbling(s, 1.5)
        )


def test_start_and_stop_of_a_call_count_from_the_log_s_own_start(flown, autopilots, import_px4):
    outputs = {"actuator_motors": autopilots.throttle(flown)}
    (dut,) = import_px4(outputs, start=1.5, stop=4.0).flights
    np.testing.assert_allclose(dut.p, flown.p[150:401], atol=1e-9)
    battery = Stream(1.0 + np.arange(9.0), {"voltage_v": 16.0 - 0.1 * np.arange(9.0)})

    def with_battery(streams):
        return tumbling(streams, 6.0) | {"battery_status": battery}

    (dut,) = import_px4(outputs, change=with_battery, stop=4.5).flights
    assert dut.t[-1] == pytest.approx(4.5)
    with pytest.raises(LogError, match="start and stop must leave samples; position has 0 in them"):
        import_px4(outputs, start=50.0)


def fallen() -> tuple[np.ndarray, ...]:
    """Return t, p, v, q of 5 s of flight, a fall of 0.8 s, an impact, and a wreck that lies on its
    side.
    """
    t = 0.01 * np.arange(800)
    height = np.where(t < 5.0, 3.2, np.maximum(3.2 - 4.905 * (t - 5.0) ** 2, 0.0))
    p = np.column_stack([np.sin(np.minimum(t, 5.0)), 0 * t, height])
    v = np.gradient(p, t, axis=0)
    half = np.where(t < 5.0, 0.05 * np.sin(t), np.minimum(0.9 * (t - 5.0), 0.75))
    return t, p, v, np.column_stack([np.cos(half), np.sin(half), 0 * t, 0 * t])


def test_a_wreck_ends_the_flight_before_its_impact():
    t, p, v, q = fallen()
    assert t[end_of_flight(t, p, v, q)] == pytest.approx(5.8, abs=0.11)


def test_a_landing_and_a_hover_are_no_crash():
    t, p, v, q = fallen()
    level = np.tile([1.0, 0.0, 0.0, 0.0], (len(t), 1))
    p[:, 2] = np.clip(3.2 - 0.8 * (t - 3.0), 0.0, 3.2)
    assert end_of_flight(t, p, np.gradient(p, t, axis=0), level) == len(t)
    assert end_of_flight(t[:500], p[:500], v[:500], q[:500]) == 500
