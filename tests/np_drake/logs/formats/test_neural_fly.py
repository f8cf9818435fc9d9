"""Laws of the Neural-Fly files: columns, and the frames of the default map by the physics of the
real flights.
"""

import numpy as np
import pytest

from np_drake.logs.formats.format import Stream
from np_drake.logs.formats.known_formats import format_of
from np_drake.logs.formats.table import NEURAL_FLY
from np_drake.logs.importing.import_log import import_log
from tests.np_drake.logs.formats.neural_fly_writer import write as write_neural_fly

FLIGHTS = [
    f"custom_figure8_{method}_{wind}.csv.gz"
    for method in ("L1", "baseline", "indi")
    for wind in ("nowind", "35wind", "100wind")
]


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


def test_a_real_flight_agrees_with_the_conventions_of_the_default_map(flight):
    assert format_of(flight) is NEURAL_FLY
    names = ["p[0]", "R[8]", "pwm[3]", "fa[2]", "q_sp[0]"]
    stream = NEURAL_FLY.read(flight, {"table": names}, lambda _: None).streams["table"]
    assert 2400 < len(stream) < 2600
    np.testing.assert_allclose(np.diff(stream.t), 0.02, atol=1e-4)
    assert all(np.isfinite(column).all() for column in stream.columns.values())
    found = import_log(flight)
    assert found.sheet.content["conventions"].startswith("agree with the log in ")
    assert found.sheet.content["columns"]["rates"]["axes"] == "world"
