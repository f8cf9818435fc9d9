"""Laws of the demo: what it flies, names and foretells, and the page that shows it."""

import dataclasses as dc
import json

import pytest

from diagrams.cli.main import run
from diagrams.demo import demo_page as page
from diagrams.demo import story
from diagrams.evidence.studies import sweep, tracking
from diagrams.loop.experiments import load_experiment

DIAGNOSED = 20.0  # of a flight that is diagnosed, so that as much is seen as in the demo itself [s]
OTHERS = 8.0  # of any other flight [s]
SIMULATED = 6.0  # of a flight in a simulator [s]
RAMP = 2.0  # of all [s]


def shortened(name, vehicle=None, reality=None):
    config = load_experiment(name, vehicle, reality)
    config.duration, config.reference.ramp = DIAGNOSED, RAMP
    return config


def configured(track, row, **how):
    config = sweep.configure(track, row, **how)
    config.duration = DIAGNOSED if row == story.NOMINAL else OTHERS
    return config


@pytest.fixture(scope="module")
def told(tmp_path_factory):
    """Folder and metrics of the verb, the demo itself, and the shares of its progress."""
    folder, kept, shares = tmp_path_factory.mktemp("demo"), [], []
    run_demo = story.run_demo

    def kept_demo(*arguments, on_progress, **options):
        def advance(share, text):
            shares.append(share)
            on_progress(share, text)

        kept.append(run_demo(*arguments, simulated=SIMULATED, on_progress=advance, **options))
        return kept[0]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(tracking, "load_experiment", shortened)
        patch.setattr(story, "configure", configured)
        patch.setattr("diagrams.demo.story.run_demo", kept_demo)
        metrics = folder / "demo.json"
        arguments = ["demo", "--out", str(folder), "--seed", "3", "--jobs", "1"]
        arguments += ["--json", str(metrics)]
        assert run(arguments) == 0
    return folder, json.loads(metrics.read_text()), kept[0], shares


def test_the_demo_names_its_four_effects_and_no_other(told):
    _, metrics, demo, _ = told
    assert set(metrics["verdict"]) == set(demo.withheld)
    assert len(demo.withheld) == 4
    for cause in demo.diagnosis.causes:
        for name, true in demo.withheld[cause.identifier].items():
            lower, upper = cause.parameters[name].ci95
            assert lower - 1e-3 <= true <= upper + 1e-3, (cause.identifier, name)


def test_all_controllers_fly_both_tracks_and_learning_helps(told):
    _, metrics, demo, _ = told
    assert list(demo.flights) == [
        (track, row.kind) for track in tracking.TRACKS for row in story.ROWS
    ]
    assert all((f.config.name, f.label) == key for key, f in demo.flights.items())
    assert metrics["reduction"]["lemniscate"]["E_xy"] > 0.5


def test_the_corrected_simulator_foretells_what_the_nominal_one_does_not(told):
    gaps = {
        name: sum(abs(line[name] - line["flight"]) for line in told[1]["meeting"])
        for name in story.SIMULATORS
    }
    assert gaps["corrected"] < 0.2 * gaps["nominal"]


def test_the_page_shows_every_number_and_leads_to_files_that_are_there(told):
    folder, metrics, demo, _ = told
    text = (folder / page.FILE).read_text(encoding="utf-8")
    assert page.headline(demo) in text
    assert "seed 3 of the training, 4 of the flights, 5 of the simulators" in text
    for flight in metrics["runs"]:
        assert f"{100 * flight['metrics']['E_xy']:.2f}" in text
    for effect, *_ in page.cause_rows(demo):
        assert effect in text
    links = [part.split('"')[0] for part in text.split('href="')[1:]]
    assert links
    assert all((folder / link).is_file() for link in links)
    assert (folder / text.split('<iframe src="')[1].split('"')[0]).is_file()
    assert "http" not in text


def test_a_wrong_or_missed_cause_stands_in_headline_and_table(told):
    demo = told[2]
    blind = dc.replace(demo.diagnosis, causes=(), verdict=("ground_effect",))
    blind = dc.replace(demo, diagnosis=blind)
    assert "0 of 4" in page.headline(blind)
    assert "1 that is not there" in page.headline(blind)
    assert [row[1] for row in page.cause_rows(blind)] == ["not named"] * 4
