"""Laws of a flight as an MCAP file: what is read back is what was recorded."""

import json
import sys

import numpy as np
import pytest

from diagrams.cli.main import run
from diagrams.loop.mcap_flight import WRENCH, write_flight_mcap

mcap_reader = pytest.importorskip("mcap.reader")
FOXGLOVE = {
    "/tf": "foxglove.FrameTransforms",
    "/scene": "foxglove.SceneUpdate",
    "/tether": "foxglove.SceneUpdate",
    "/reference/pose": "foxglove.PoseInFrame",
    "/quadrotor/pose": "foxglove.PoseInFrame",
}
SHORT = ["fly", "hover", "--controller", "nominal", "--duration", "0.1"]


@pytest.fixture(scope="module")
def flight(flown):
    return flown("circle", "np")


@pytest.fixture(scope="module")
def file(flight, tmp_path_factory):
    path = tmp_path_factory.mktemp("mcap") / "flight.mcap"
    write_flight_mcap(flight, path)
    return path


@pytest.fixture(scope="module")
def messages(file):
    """Schema, message and content of all messages by topic, in the order of the file."""
    found, times = {}, []
    with file.open("rb") as stream:
        reader = mcap_reader.make_reader(stream, validate_crcs=True)
        for schema, channel, message in reader.iter_messages(log_time_order=False):
            numbers = channel.message_encoding == "json"
            assert schema.encoding == ("jsonschema" if numbers else "protobuf")
            times.append(message.log_time)
            content = json.loads(message.data) if numbers else message.data
            found.setdefault(channel.topic, []).append((schema, message, content))
    assert times == sorted(times)
    return found


def test_there_is_a_message_a_row_of_the_recorder_at_its_time(flight, messages):
    expected = np.round(1e9 * flight.signals["t"]).astype(np.int64)
    for topic, rows in messages.items():
        assert len(rows) == (1 if topic == "/scene" else len(expected)), topic
        assert [message.log_time for _, message, _ in rows] == expected[: len(rows)].tolist()


def test_every_message_has_the_schema_that_foxglove_knows(messages):
    for topic, rows in messages.items():
        known = FOXGLOVE.get(topic, "np_drake." + topic[1:].replace("/", "_"))
        assert rows[0][0].name == known
        assert topic in FOXGLOVE or set(json.loads(rows[0][0].data)["properties"]) == set(
            rows[-1][-1]
        )
    assert set(FOXGLOVE) <= set(messages)


def test_numbers_are_those_of_the_flight_bit_for_bit(flight, messages):
    s = flight.signals
    for topic, names, expected in (
        ("/velocity", "xyz", s["x_true"][:, 7:10]),
        ("/command", ("thrust", "tau_x", "tau_y", "tau_z"), flight.log().u),
        ("/measured", ("p_x", "q_w", "v_z", "w_z"), flight.log().x[:, [0, 3, 9, 12]]),
        ("/wrench/true", WRENCH, flight.chi_true),
        ("/rotor_thrust", ("f_1", "f_4"), s["rotor_thrust"][:, [0, 3]]),
        ("/solve", ("time", "status"), np.hstack([s["solve_time"], s["status"]])),
    ):
        found = [[content[name] for name in names] for *_, content in messages[topic]]
        np.testing.assert_array_equal(found, expected, err_msg=topic)


@pytest.mark.parametrize("name, message", [("a.csv", "ends in .mcap"), ("a.mcap", "[mcap]")])
def test_what_cannot_be_written_is_refused_before_the_flight(
    tmp_path, monkeypatch, capsys, name, message
):
    monkeypatch.chdir(tmp_path)
    if name == "a.mcap":
        monkeypatch.setitem(sys.modules, "foxglove", None)
    assert run([*SHORT, "--mcap", name]) == 2
    err = capsys.readouterr().err
    assert message in err.splitlines()[-1]
    assert "flying" not in err
    assert list(tmp_path.iterdir()) == []
