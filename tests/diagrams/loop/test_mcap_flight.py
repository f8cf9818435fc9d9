"""Laws of a flight as an MCAP file: what is read back is what was recorded."""

import json
import sys

import jsonschema
import numpy as np
import pytest

from diagrams.cli.main import run
from diagrams.loop.experiments import load_experiment
from diagrams.loop.flight_result import fly
from diagrams.loop.mcap_flight import WRENCH, write_flight_mcap

mcap_reader = pytest.importorskip("mcap.reader")
ONCE = ("/scene", "/reference/path")
FOXGLOVE = {
    "/tf": "foxglove.FrameTransforms",
    "/scene": "foxglove.SceneUpdate",
    "/tether": "foxglove.SceneUpdate",
    "/reference/path": "foxglove.PosesInFrame",
    "/reference/pose": "foxglove.PoseInFrame",
    "/quadrotor/pose": "foxglove.PoseInFrame",
}
SHORT = ["fly", "hover", "--controller", "nominal", "--duration", "0.1"]


@pytest.fixture(scope="module")
def flight():
    config = load_experiment("circle")
    config.duration, config.reference.ramp = 0.5, 0.5
    config.controller.kind, config.controller.solver = "np", "sqp"
    return fly(config, seed=2)


@pytest.fixture(scope="module")
def file(flight, tmp_path_factory):
    path = tmp_path_factory.mktemp("mcap") / "flight.mcap"
    write_flight_mcap(flight, path)
    return path


@pytest.fixture(scope="module")
def messages(file):
    """Schema, channel, message and content of all messages by topic, in the order of the file."""
    found = {}
    with file.open("rb") as stream:
        reader = mcap_reader.make_reader(stream, validate_crcs=True)
        for schema, channel, message in reader.iter_messages(log_time_order=False):
            assert (schema.encoding, channel.message_encoding) == ("jsonschema", "json")
            content = json.loads(message.data)
            found.setdefault(channel.topic, []).append((schema, channel, message, content))
    return found


def column(messages, topic, name):
    return np.array([content[name] for *_, content in messages[topic]])


def test_there_is_a_message_a_row_of_the_recorder(flight, messages):
    counts = {topic: len(rows) for topic, rows in messages.items()}
    rows = len(flight.signals["t"])
    assert counts == {topic: 1 if topic in ONCE else rows for topic in messages}
    assert {"/velocity", "/error", "/command", "/wrench/true", "/wrench/foreseen", "/solve"} < set(
        messages
    )


def test_times_are_those_of_the_recorder_in_nanoseconds_and_increase(flight, file, messages):
    expected = np.round(1e9 * flight.signals["t"]).astype(np.int64)
    for topic, rows in messages.items():
        times = [message.log_time for *_, message, _ in rows]
        assert times == expected[: len(rows)].tolist(), topic
        assert times == [message.publish_time for *_, message, _ in rows]
        assert [message.sequence for *_, message, _ in rows] == list(range(len(rows)))
    with file.open("rb") as stream:
        times = [
            m.log_time
            for *_, m in mcap_reader.make_reader(stream).iter_messages(log_time_order=False)
        ]
    assert times == sorted(times)


def test_every_message_suits_its_schema(messages):
    for rows in messages.values():
        schema = json.loads(rows[0][0].data)
        validator = jsonschema.Draft7Validator(schema)
        validator.check_schema(schema)
        for *_, content in rows[:: max(1, len(rows) // 5)]:
            validator.validate(content)


def test_frames_scene_and_paths_have_foxgloves_names(messages):
    assert {
        topic: rows[0][0].name for topic, rows in messages.items() if topic in FOXGLOVE
    } == FOXGLOVE
    for topic, rows in messages.items():
        assert json.loads(rows[0][0].data)["title"] == rows[0][0].name
        assert rows[0][0].name.startswith("foxglove." if topic in FOXGLOVE else "np_drake.")


def test_stamps_inside_the_messages_are_those_outside(messages):
    for topic in ("/error", "/reference/pose"):
        for *_, message, content in messages[topic]:
            stamp = content["timestamp"]
            assert stamp["sec"] * 10**9 + stamp["nsec"] == message.log_time


@pytest.mark.parametrize(
    "topic, names, signal",
    [
        ("/velocity", ("x", "y", "z"), lambda f: f.signals["x_true"][:, 7:10]),
        ("/command", ("thrust", "tau_x", "tau_y", "tau_z"), lambda f: f.log().u),
        ("/measured", ("p_x", "q_w", "v_z", "w_z"), lambda f: f.log().x[:, [0, 3, 9, 12]]),
        ("/error", ("x", "y", "z"), lambda f: f.signals["x_true"][:, :3] - f.signals["p_ref"]),
        ("/wrench/true", WRENCH, lambda f: f.chi_true),
        ("/wrench/label", WRENCH, lambda f: f.signals["label"]),
        ("/wrench/foreseen", WRENCH, lambda f: f.chi_foreseen),
        (
            "/solve",
            ("time", "status"),
            lambda f: np.hstack([f.signals["solve_time"], f.signals["status"]]),
        ),
    ],
)
def test_numbers_are_those_of_the_flight_bit_for_bit(flight, messages, topic, names, signal):
    found = np.stack([column(messages, topic, name) for name in names], axis=1)
    np.testing.assert_array_equal(found, signal(flight))


def test_frames_are_where_vehicle_and_payload_are(flight, messages):
    for k, (*_, content) in enumerate(messages["/tf"]):
        quadrotor, payload = content["transforms"]
        assert (quadrotor["child_frame_id"], payload["child_frame_id"]) == ("quadrotor", "payload")
        x = flight.signals["x_true"][k]
        assert [quadrotor["translation"][c] for c in "xyz"] == x[:3].tolist()
        assert [quadrotor["rotation"][c] for c in "wxyz"] == x[3:7].tolist()
        assert [payload["translation"][c] for c in "xyz"] == flight.payload_position[k].tolist()


def test_the_tether_joins_hook_and_payload(flight, messages):
    length = flight.config.reality.payload.length
    for *_, content in messages["/tether"]:
        a, b = ([p[c] for c in "xyz"] for p in content["entities"][0]["lines"][0]["points"])
        assert np.linalg.norm(np.subtract(a, b)) == pytest.approx(
            length, rel=0.01
        )  # the cable stretches


def test_the_path_is_the_reference(flight, messages):
    points = [
        [p["position"][c] for c in "xyz"] for p in messages["/reference/path"][0][-1]["poses"]
    ]
    np.testing.assert_array_equal(points, flight.signals["p_ref"][::5])


def test_one_flight_is_one_file_bit_for_bit(flight, file, tmp_path):
    write_flight_mcap(flight, tmp_path / "again.mcap")
    assert (tmp_path / "again.mcap").read_bytes() == file.read_bytes()


def test_a_flight_without_payload_is_written_too(tmp_path, capsys):
    (tmp_path / "bare.yaml").write_text(
        "name: bare\nduration: 0.1\nreference: {track: hover, ramp: 0.1}\n"
        "reality: {payload: {tether: none}}\ncontroller: {kind: nominal, solver: sqp}\n"
    )
    target = tmp_path / "bare.mcap"
    assert run(["fly", str(tmp_path / "bare.yaml"), "--mcap", str(target)]) == 0, (
        capsys.readouterr().err
    )
    assert f"MCAP: {target}" in capsys.readouterr().out
    with target.open("rb") as stream:
        topics = {
            channel.topic for _, channel, _ in mcap_reader.make_reader(stream).iter_messages()
        }
    assert "/tf" in topics
    assert "/tether" not in topics


BAD = {  # further arguments: what the line says
    "folder": (["--mcap", "nowhere/a.mcap"], "nowhere must exist"),
    "suffix": (["--mcap", "a.csv"], "must be a file whose name ends in .mcap"),
    "model": (["--controller", "gp", "--predictor", "in.mcap", "--mcap", "in.mcap"], "in.mcap"),
    "metrics": (
        ["--json", "a.mcap", "--mcap", "./a.mcap"],
        "a.mcap: must be named by one option alone",
    ),
}


@pytest.mark.parametrize("case", BAD)
def test_a_file_that_cannot_be_written_is_refused_before_the_flight(
    tmp_path, monkeypatch, capsys, case
):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "in.mcap").write_text("an input")
    more, message = BAD[case]
    assert run([*SHORT, *more]) == 2
    err = capsys.readouterr().err
    assert message in err.splitlines()[-1]
    assert "flying" not in err
    assert [path.name for path in tmp_path.iterdir()] == ["in.mcap"]
    assert (tmp_path / "in.mcap").read_text() == "an input"


def test_an_input_is_not_overwritten(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "x").mkdir()
    vehicle = tmp_path / "vehicle.mcap"
    vehicle.write_text("name: mine\n")
    assert run([*SHORT, "--vehicle", str(vehicle), "--mcap", "x/../vehicle.mcap"]) == 2
    assert "vehicle.mcap" in capsys.readouterr().err.splitlines()[-1]
    assert vehicle.read_text() == "name: mine\n"


def test_without_the_extra_one_line_says_how_to_install_it(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setitem(sys.modules, "mcap", None)
    assert run([*SHORT, "--mcap", "a.mcap"]) == 2
    assert "pip install 'np_drake[mcap]'" in capsys.readouterr().err.splitlines()[-1]
    assert not list(tmp_path.iterdir())


def test_nothing_is_left_of_a_file_that_fails(flight, tmp_path, monkeypatch):
    from diagrams.loop import mcap_flight

    def broken(flight):
        yield from list(mcap_flight_channels(flight))[:3]
        raise RuntimeError("out of paper")

    mcap_flight_channels = mcap_flight.channels
    monkeypatch.setattr(mcap_flight, "channels", broken)
    with pytest.raises(RuntimeError, match="out of paper"):
        write_flight_mcap(flight, tmp_path / "a.mcap")
    assert not list(tmp_path.iterdir())
