"""A verb refuses an output into which another run writes, whatever the option that names it."""

import pytest

from diagrams.cli.main import run
from np_drake.files.atomic_file import lock_outputs

PRESET = ["vehicle", "new", "--preset", "crazyflie", "--out"]
MAKE = [
    "challenge",
    "make",
    "--cases",
    "0",
    "--clean",
    "1",
    "--seconds",
    "8",
    "--out",
    "own",
    "--truth",
]


@pytest.mark.parametrize(
    ("arguments", "name", "folder"),
    [
        (PRESET, "mine.yaml", False),
        (MAKE, "truth", True),
        (["fly", "hover", "--duration", "0.2", "--mcap"], "flight.mcap", False),
        (["fly", "hover", "--duration", "0.2", "--out"], "flight", True),
    ],
)
def test_an_output_that_another_run_holds_is_refused_before_any_work(
    tmp_path, monkeypatch, capsys, arguments, name, folder
):
    monkeypatch.chdir(tmp_path)
    path = tmp_path / name
    with lock_outputs([path] if folder else [], [] if folder else [path]):
        before = set(tmp_path.rglob("*"))
        assert run([*arguments, name]) == 2
        said = capsys.readouterr()
        assert "another run" in said.err
        assert "writes here" in said.err
        assert set(tmp_path.rglob("*")) == before
    assert not set(tmp_path.rglob(".*lock"))


def test_a_lock_goes_with_its_run(tmp_path):
    path = tmp_path / "mine.yaml"
    assert run([*PRESET, str(path)]) == 0
    assert list(tmp_path.iterdir()) == [path]
