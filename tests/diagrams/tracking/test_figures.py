import pytest

from diagrams.loop.experiments import load_experiment
from diagrams.loop.flight_result import fly
from diagrams.loop.replay.flight_page import write_replay
from diagrams.tracking import figures
from np_drake.files.figure_file import save


@pytest.fixture(scope="module")
def flight():
    config = load_experiment("circle")
    config.duration, config.reference.ramp = 0.5, 0.5
    config.controller.kind, config.controller.solver = "hold", "sqp"
    return fly(config, seed=0)


@pytest.mark.parametrize("draw", [figures.wrench, lambda f: figures.plane_track([f]), lambda f: figures.errors([f])])
def test_every_axis_has_a_label_with_its_unit_and_the_figure_a_legend(flight, draw):
    figure = draw(flight)
    axes = figure.get_axes()
    assert all("[" in ax.get_ylabel() for ax in axes)
    assert any("[" in ax.get_xlabel() for ax in axes)
    assert figure.legends


def test_a_figure_is_written_as_png(flight, tmp_path):
    save(figures.plane_track([flight]), tmp_path / "track.png")
    assert (tmp_path / "track.png").read_bytes().startswith(b"\x89PNG")


def test_the_replay_stands_alone_and_names_what_moves(flight, tmp_path):
    write_replay(flight, tmp_path / "replay.html")
    page = (tmp_path / "replay.html").read_text()
    assert len(page) > 100_000  # the viewer itself is inside
    assert 'src="http' not in page
