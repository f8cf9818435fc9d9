"""Laws of the Neural-Fly files: columns, and the frames of the default map by the physics of the
real flights.
"""

import numpy as np
import pytest
from scipy.signal import butter, filtfilt
from scipy.spatial.transform import Rotation

from np_drake.logs.formats.format import Stream, by_stream
from np_drake.logs.formats.library import format_of
from np_drake.logs.formats.table import NEURAL_FLY
from tests.np_drake.logs.formats.neural_fly_writer import write as write_neural_fly

FLIGHTS = [
    f"custom_figure8_{method}_{wind}.csv.gz"
    for method in ("L1", "baseline", "indi")
    for wind in ("nowind", "35wind", "100wind")
]
GRAVITY = 9.81  # [m/s²]


def read_mapped(path, *more):
    """Read what the default map names, and more columns."""
    contents = NEURAL_FLY.contents(path)
    log_map = NEURAL_FLY.default_map(contents)
    wanted = by_stream(contents, [*log_map.names(), *more])
    stream = NEURAL_FLY.read(path, wanted, lambda _: None).streams["table"]
    fields = {
        name: np.stack([stream.columns[c] for c in source.columns], axis=1)
        for name, source in log_map.sources()
    }
    return stream, fields, log_map


@pytest.fixture(params=FLIGHTS)
def flight(request, real_flights):
    """Path of each of the real flights."""
    return real_flights / "neural_fly" / request.param


def test_what_was_written_is_read_bit_for_bit(tmp_path):
    draw = np.random.default_rng(0)
    names = ("p[0]", "R[7]", "T_sp[0]", "pwm[3]")
    made = Stream(0.02 * np.arange(30), {name: draw.normal(size=30) for name in names})
    for path in (tmp_path / "made.csv", tmp_path / "made.csv.gz"):
        write_neural_fly(path, {"table": made})
        assert format_of(path) is NEURAL_FLY
        dut = NEURAL_FLY.read(path, {"table": list(names)}, lambda _: None)
        np.testing.assert_array_equal(dut.streams["table"].t, made.t)
        for name in names:
            np.testing.assert_array_equal(dut.streams["table"].columns[name], made.columns[name])


def test_a_file_without_its_columns_has_no_default_map():
    assert NEURAL_FLY.default_map({"table": ("t", "p[0]")}) is None


def test_a_real_flight_is_recognised_with_all_its_columns(flight):
    assert format_of(flight) is NEURAL_FLY
    stream, _, log_map = read_mapped(flight, "R[8]", "pwm[3]", "fa[2]", "q_sp[0]")
    assert 2400 < len(stream) < 2600
    np.testing.assert_allclose(np.diff(stream.t), 0.02, atol=1e-4)
    assert all(np.isfinite(column).all() for column in stream.columns.values())
    assert log_map.command == "sampled"


def test_the_rates_are_those_of_the_attitude_in_axes_of_w(flight):
    """In the fastest wind the body leans by 0.5 rad, and rates in axes of B are off by up to half
    their size.
    """
    stream, fields, log_map = read_mapped(flight)
    rotation, step = Rotation.from_quat(fields["attitude"]), np.median(np.diff(stream.t))
    in_body = (rotation[:-1].inv() * rotation[1:]).as_rotvec() / step
    in_world = rotation[:-1].apply(in_body)
    logged = (fields["rates"][1:] + fields["rates"][:-1]) / 2
    smooth = low_pass(4.0, step)
    error = {"world": rms(smooth(in_world - logged)), "body": rms(smooth(in_body - logged))}
    assert log_map.rates.axes == "world"
    assert error["world"] < 0.012  # [rad/s]
    assert error["world"] < error["body"] / (2 if "100wind" in flight.name else 1)


def test_w_is_z_up_and_thrust_carries_the_weight(flight):
    """Specific force along body z is near T_sp / hover_throttle in weights; in wind at 12 m/s lift
    adds to it.
    """
    stream, fields, log_map = read_mapped(flight)
    step = np.median(np.diff(stream.t))
    smooth = low_pass(3.0, step)
    acceleration = smooth(np.gradient(fields["velocity"], stream.t, axis=0))
    rotation = Rotation.from_quat(fields["attitude"])
    force = rotation.inv().apply(acceleration + [0, 0, GRAVITY])[:, 2] / GRAVITY
    command = smooth(fields["throttle"] / fields["hover_throttle"])[:, 0]
    assert (log_map.world, log_map.body) == ("enu", "flu")
    if "100wind" in flight.name:
        assert 0.85 < force.mean() < 0.92
        assert 1.2 < command.mean() < 1.3
        return
    assert abs(force.mean() - command.mean()) < 0.02  # [weights]
    assert np.corrcoef(force, command)[0, 1] > 0.98
    exponent = np.polyfit(np.log(command), np.log(force), 1)[0]
    assert 1.2 < exponent < 1.45  # thrust grows faster than the command


def low_pass(frequency, step):
    """Return a zero-phase low-pass [Hz]."""
    numerator, denominator = butter(2, 2 * frequency * step)
    return lambda values: filtfilt(numerator, denominator, values, axis=0)


def rms(values):
    """Return the root mean square."""
    return float(np.sqrt(np.mean(np.square(values))))
