"""Laws of the report's folder."""

import dataclasses as dc
import json
import re
import shutil
import subprocess

import numpy as np
import pytest
from matplotlib.image import imread

from np_drake.diagnosis.report import write
from np_drake.diagnosis.report.page import SEEN, content
from np_drake.diagnosis.report.write import write_report
from np_drake.diagnosis.result import ChannelGap

HOSTILE = '<script>alert("x")</script>&$\\frac{$ 飞.csv'
BROWSERS = ("chromium", "chromium-browser", "google-chrome", "chrome")


@pytest.fixture(scope="module")
def folder(diagnosis, tmp_path_factory):
    path = tmp_path_factory.mktemp("report")
    write_report(diagnosis, path, seed=7, config={"train": ["a.csv"]})
    return path


@pytest.fixture
def undrawn(monkeypatch):
    """Pictures are made and not drawn, where a test reads the page alone."""
    monkeypatch.setattr(write, "png", lambda figure: b"picture")


def test_the_folder_holds_page_data_and_pictures(folder):
    pictures = {f"{name}.png" for name in ("ladder", "regimes", "timeline", "spectrum", "replay")}
    assert {path.name for path in folder.iterdir()} == {"report.html", "diagnosis.json", *pictures}


def test_the_data_begin_as_every_file_of_the_project(folder):
    content = json.loads((folder / "diagnosis.json").read_text())
    assert content["schema"] == "np_drake.diagnosis/1"
    assert (content["seed"], content["config"]) == (7, {"train": ["a.csv"]})
    assert content["version"].count(".") == 2
    assert content["verdict"] == ["suspended_payload", "linear_drag"]


def test_the_page_stands_alone(folder):
    page = (folder / "report.html").read_text()
    assert re.findall(r"(?:src|href)\s*=\s*(.{6})", page) == ['"data:'] * 5
    assert "url(" not in page
    assert "<script" not in page
    assert page.count("data:image/png;base64,") == 5


def test_the_page_says_all_that_was_found(folder):
    page = (folder / "report.html").read_text()
    for text in (
        "suspended_payload",
        "0.255 … 0.266",
        "heldout_2",
        "Roll and pitch sharply",
        "gyroscope bias",
    ):
        assert text.lower() in page.lower()
    for heading in ("How far", "Where", "Which", "cannot tell", "Replay", "What remains", "Minor", "checked"):
        assert heading in page


def test_a_page_without_a_verdict_claims_nothing(diagnosis, tmp_path, undrawn):
    shrink = dc.replace(diagnosis.shrink, ladder=(), replay_before=None, replay_after=None)
    (tmp_path / "replay.png").write_bytes(b"of an earlier diagnosis")
    write_report(dc.replace(diagnosis, cannot_tell=True, verdict=(), causes=(), shrink=shrink), tmp_path)
    assert not (tmp_path / "replay.png").exists()
    page = (tmp_path / "report.html").read_text()
    assert "No verdict" in page
    assert "No replay was made" in page
    assert "Probability that" not in page


@pytest.mark.parametrize(("before", "shown"), [(0.99 * SEEN, "–"), (1.01 * SEEN, "−50")])
def test_where_a_channel_has_hardly_a_gap_no_share_of_it_is_explained(diagnosis, before, shown):
    channel = ChannelGap("force y", "N", before, 1.0, before, -0.5)
    dut = dc.replace(diagnosis, where=dc.replace(diagnosis.where, channels=(channel,)))
    ((*_, explained),) = content(dut, 0)["channels"]
    assert explained.startswith(shown)


@pytest.mark.parametrize("share", [0.94, float("nan")])
def test_a_share_is_said_to_be_of_the_trace_where_there_is_one(diagnosis, tmp_path, undrawn, share):
    causes = (dc.replace(diagnosis.causes[0], share=share),)
    write_report(dc.replace(diagnosis, causes=causes), tmp_path)
    assert ("Its own trace is 94" in (tmp_path / "report.html").read_text()) == (share == 0.94)
    (written,) = json.loads((tmp_path / "diagnosis.json").read_text())["causes"]
    assert written["share"] == (0.94 if share == 0.94 else None)


def test_hostile_names_are_text(diagnosis, tmp_path):
    where = dc.replace(diagnosis.where, regimes=(), bands=())  # whose figures have no names of the logs
    renamed = {name: {HOSTILE: traces["heldout_1"]} for name, traces in _traces(where).items()}
    causes = (dc.replace(diagnosis.causes[0], onset={HOSTILE: 3.0}),)
    dut = dc.replace(
        diagnosis,
        vehicle=HOSTILE,
        train=(HOSTILE,),
        held_out=(HOSTILE,),
        causes=causes,
        warnings=(HOSTILE,),
        where=dc.replace(where, **renamed),
    )
    write_report(dut, tmp_path)
    page = (tmp_path / "report.html").read_text()
    assert "<script" not in page
    assert "&lt;script&gt;" in page
    assert json.loads((tmp_path / "diagnosis.json").read_text())["vehicle"] == HOSTILE


def test_nothing_is_written_where_the_folder_is_missing(diagnosis, tmp_path):
    with pytest.raises(FileNotFoundError, match="nowhere"):
        write_report(diagnosis, tmp_path / "nowhere")
    assert list(tmp_path.iterdir()) == []


def test_a_browser_shows_the_page(folder, tmp_path):
    browser = next(filter(None, map(shutil.which, BROWSERS)), None)
    if browser is None:
        pytest.skip("no Chromium or Chrome on this machine: the page is not looked at")
    picture = tmp_path / "page.png"
    options = "--headless --no-sandbox --disable-quic --no-first-run --disable-background-networking"
    options += " --disable-component-update --disable-sync --hide-scrollbars --window-size=1000,3000"
    command = [
        browser,
        *options.split(),
        f"--user-data-dir={tmp_path / 'profile'}",
        f"--screenshot={picture}",
    ]
    subprocess.run(
        [*command, (folder / "report.html").as_uri()],
        check=True,
        capture_output=True,
        timeout=120,
    )
    pixels = imread(picture)[..., :3]
    assert pixels.shape[:2] == (3000, 1000)
    for part in np.array_split(pixels, 6):  # text or figures all the way down
        assert np.std(part) > 0.02


def _traces(where):
    return {"times": where.times, "before": where.before, "after": where.after}
