"""Laws of `np-drake reproduce real` before its long work: bad input is one line and exit code 2."""

import pytest

from diagrams.cli.main import run


@pytest.fixture(autouse=True)
def no_folders_of_the_environment(monkeypatch):
    for name in ("NP_DRAKE_REAL", "NP_DRAKE_NEUROBEM"):
        monkeypatch.delenv(name, raising=False)


def refused(capfd, *arguments: str) -> str:
    """Return the one line on stderr of a refused command."""
    assert run(["reproduce", "real", *arguments]) == 2
    (line,) = [text for text in capfd.readouterr().err.splitlines() if text and "opening the logs" not in text]
    return line


def test_a_folder_that_is_missing_or_empty_is_said(capfd, tmp_path):
    assert "NP_DRAKE_REAL" in refused(capfd)
    assert "not there" in refused(capfd, str(tmp_path / "nowhere"))
    assert "got none" in refused(capfd, str(tmp_path))
    assert "not there" in refused(capfd, str(tmp_path), "--neurobem", str(tmp_path / "nowhere"))


def test_a_log_that_cannot_be_read_is_named_and_nothing_is_left(capfd, tmp_path):
    place = tmp_path / "imrc" / "bare"
    place.mkdir(parents=True)
    for number in (1, 2, 11):
        (place / f"flight{number:02}").write_bytes(b"no log")
    out = tmp_path / "out"
    line = refused(capfd, str(tmp_path), "--out", str(out))
    assert "flight" in line
    assert not list(tmp_path.glob("out/**/*.json"))


def test_an_unknown_group_is_said(capfd, tmp_path):
    assert "--only" in refused(capfd, str(tmp_path), "--only", "storm")
