"""Laws of the report's folder."""

import dataclasses as dc
import html
import json
import re
import shutil
import subprocess

import numpy as np
import pytest
from matplotlib.image import imread

from np_drake.diagnosis.report.page import write_report
from np_drake.diagnosis.result import Finding
from np_drake.files import page

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
    monkeypatch.setattr(page, "png", lambda figure: b"picture")


def test_the_folder_holds_page_data_and_pictures(folder):
    pictures = {f"{name}.png" for name in ("regimes", "timeline", "spectrum", "replay")}
    assert {path.name for path in folder.iterdir()} == {"report.html", "diagnosis.json", *pictures}


def test_the_data_begin_as_every_file_of_the_project(folder):
    content = json.loads((folder / "diagnosis.json").read_text())
    assert content["schema"] == "np_drake.diagnosis/1"
    assert (content["seed"], content["config"]) == (7, {"train": ["a.csv"]})
    assert content["version"].count(".") == 2
    assert content["verdict"] == ["suspended_payload", "linear_drag"]


def test_the_page_stands_alone(folder):
    page = (folder / "report.html").read_text()
    assert re.findall(r"(?:src|href)\s*=\s*(.{6})", page) == ['"data:'] * 4
    assert "url(" not in page
    assert "<script" not in page
    assert page.count("data:image/png;base64,") == 4


def text_of(page):
    """The words of a page, without its marks."""
    return " ".join(
        html.unescape(re.sub(r"<style.*?</style>|<[^>]+>", " ", page, flags=re.S)).split()
    )


def test_the_page_gives_the_answer_first_and_then_what_it_rests_on(folder):
    page = text_of((folder / "report.html").read_text())
    order = (
        (
            "A 260 g payload on 0.81 m, linear drag of up to 0.24 N·s/m and calibration "
            "explain 99.8 % of the gap"
        ),
        "Each has a probability of 93 % or more.",
        "What differs from the vehicle file",
        "Rotor 2: thrust +4.0 %",
        "What the model lacks",
        "255 to 266",
        "quadratic_drag",
        "What remains",
        "0.2 % of the held-out gap is left",
        "Probability that this is material",
        "vertical force",
        "Minor findings (1)",
        "What to do next",
        "What the flights tested",
        "linear drag was not tested",
        "Where the gap is",
        "Replay",
        "Checks",
        "Roll and pitch sharply".lower(),
    )
    places = [page.find(text) for text in order]
    assert -1 not in places, order[places.index(-1)]
    assert places == sorted(places)


def test_a_second_answer_is_shown_beside_the_first(diagnosis, tmp_path, undrawn):
    second = dc.replace(
        diagnosis, verdict=("linear_drag",), causes=diagnosis.causes[1:], joined=("heldout_1",)
    )
    novel = (Finding("wind", "a slow force along x, 3 N", 3.0),)
    dut = dc.replace(diagnosis, verdict=(), causes=(), new_on_held_out=novel, refit=second)
    page = text_of(write_report(dut, tmp_path).read_text())
    assert page.index("Second answer") < page.index("What to do next")
    assert "show what the training flights do not: a slow force along x, 3 N." in page
    assert "With the first halves of heldout_1 in the fit" in page
    assert "Linear drag of up to 0.24 N·s/m and calibration explain" in page
    alone = text_of(write_report(dc.replace(dut, refit=None), tmp_path).read_text())
    assert "too short for a second answer" in alone
    assert "Second answer" not in text_of(write_report(diagnosis, tmp_path).read_text())


def test_new_fields_go_through_json(diagnosis, tmp_path, undrawn):
    novel = (Finding("wind", "a slow force along x, 3 N", 3.0, {"force": 3.0}),)
    dut = dc.replace(
        diagnosis,
        new_on_held_out=novel,
        coverage=("a sentence.",),
        refit=dc.replace(diagnosis, joined=("heldout_1",)),
    )
    write_report(dut, tmp_path)
    content = json.loads((tmp_path / "diagnosis.json").read_text())
    assert content["coverage"] == ["a sentence."]
    assert content["novel"] == [
        {
            "name": "wind",
            "text": "a slow force along x, 3 N",
            "size": 3.0,
            "figures": {"force": 3.0},
            "measurement": "",
        }
    ]
    assert set(content["refit"]) == set(diagnosis.as_json()) - {"schema"}
    assert (content["refit"]["joined"], content["refit"]["refit"]) == (["heldout_1"], None)
    assert diagnosis.as_json()["refit"] is None


def test_a_page_without_a_verdict_claims_nothing(diagnosis, tmp_path, undrawn):
    gap_reduction = dc.replace(diagnosis.gap_reduction, replay_before=None, replay_after=None)
    (tmp_path / "replay.png").write_bytes(b"of an earlier diagnosis")
    write_report(
        dc.replace(diagnosis, cannot_tell=True, verdict=(), causes=(), gap_reduction=gap_reduction),
        tmp_path,
    )
    assert not (tmp_path / "replay.png").exists()
    page = (tmp_path / "report.html").read_text()
    assert "No verdict" in page
    assert "No replay was made" in page
    assert "robability" not in page


def test_a_vehicle_that_its_file_describes_has_no_section_of_differences(
    diagnosis, tmp_path, undrawn
):
    described = dc.replace(diagnosis, calibration=())
    assert "differs from" not in text_of(write_report(described, tmp_path).read_text())
    slight = dc.replace(diagnosis, calibration=(dc.replace(diagnosis.calibration[0], value=0.001),))
    assert "Nothing by more than healthy vehicles differ" in text_of(
        write_report(slight, tmp_path).read_text()
    )


@pytest.mark.parametrize("share", [0.94, float("nan")])
def test_a_share_is_written_where_there_is_one(diagnosis, share):
    shared = dc.replace(diagnosis, causes=(dc.replace(diagnosis.causes[0], share=share),))
    (written,) = shared.as_json()["causes"]
    assert written["share"] == (0.94 if share == 0.94 else None)


def test_hostile_names_are_text(diagnosis, tmp_path):
    where = dc.replace(
        diagnosis.localisation, regimes=(), bands=()
    )  # whose figures have no names of the logs
    renamed = {name: {HOSTILE: traces["heldout_1"]} for name, traces in _traces(where).items()}
    causes = (dc.replace(diagnosis.causes[0], onset={HOSTILE: 3.0}),)
    dut = dc.replace(
        diagnosis,
        vehicle=HOSTILE,
        train=(HOSTILE,),
        held_out=(HOSTILE,),
        causes=causes,
        warnings=(HOSTILE,),
        localisation=dc.replace(where, **renamed),
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
    options = (
        "--headless --no-sandbox --disable-quic --no-first-run --disable-background-networking"
    )
    options += (
        " --disable-component-update --disable-sync --hide-scrollbars --window-size=1000,3000"
    )
    command = [
        browser,
        *options.split(),
        f"--user-data-dir={tmp_path / 'profile'}",
        f"--screenshot={picture}",
    ]
    subprocess.run(
        [*command, (folder / "report.html").as_uri()], check=True, capture_output=True, timeout=120
    )
    pixels = imread(picture)[..., :3]
    assert pixels.shape[:2] == (3000, 1000)
    for part in np.array_split(pixels, 6):  # text or figures all the way down
        assert np.std(part) > 0.02


WIDTHS = (390, 800, 1200)  # of a phone, a tablet, a screen
FRAMES = """<!DOCTYPE html><body>{frames}<script>onload = () => setTimeout(() => {{
document.body.innerText = [...document.querySelectorAll("iframe")].map((f) => {{
const page = f.contentDocument;
page.querySelectorAll("details").forEach((d) => (d.open = true));
const right = [...page.querySelectorAll("table, .scroll, h1, p")].map((e) => e.getBoundingClientRect().right);
const least = Math.min(...[...page.querySelectorAll("img")].map((e) => e.getBoundingClientRect().width));
const sign = f.contentWindow.getComputedStyle(page.querySelector("figure .scroll"), "::before").content;
const wide = Math.max(page.documentElement.scrollWidth, ...right);
return "wide:" + wide + " least:" + least + " sign:" + sign; }}).join(" "); }}, 300);</script></body>"""  # noqa: E501


def test_nothing_is_wider_than_a_phone_a_tablet_or_a_screen(folder, tmp_path):
    browser = next(filter(None, map(shutil.which, BROWSERS)), None)
    if browser is None:
        pytest.skip("no Chromium or Chrome on this machine: the page is not measured")
    page = (folder / "report.html").as_uri()
    frames = "".join(
        f'<iframe src="{page}" style="border:0;width:{w}px;height:900px"></iframe>' for w in WIDTHS
    )
    (tmp_path / "frames.html").write_text(FRAMES.format(frames=frames))
    options = (
        "--headless --no-sandbox --disable-quic --no-first-run "
        "--allow-file-access-from-files --dump-dom"
    )
    command = [
        browser,
        *options.split(),
        "--virtual-time-budget=5000",
        f"--user-data-dir={tmp_path / 'profile'}",
    ]
    shown = subprocess.run(
        [*command, (tmp_path / "frames.html").as_uri()],
        check=True,
        capture_output=True,
        text=True,
        timeout=120,
    ).stdout
    found = [float(width) for width in re.findall(r"wide:([\d.]+)", shown)]
    assert len(found) == len(WIDTHS)
    assert [width <= most + 1 for width, most in zip(found, WIDTHS, strict=True)] == [True] * 3, (
        found
    )
    figures = [float(width) for width in re.findall(r"least:([\d.]+)", shown)]
    assert min(figures) >= 600, "text of a figure is too small to read"
    assert ["scroll" in sign for sign in re.findall(r"sign:(\S+)", shown)] == [True, False, False]


def test_the_page_has_a_dark_mode(folder):
    page = (folder / "report.html").read_text()
    assert "@media (prefers-color-scheme: dark)" in page
    assert "color-scheme: light dark" in page


def _traces(where):
    return {"times": where.times, "before": where.before, "after": where.after}
