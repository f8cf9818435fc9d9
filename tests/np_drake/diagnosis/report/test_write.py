"""Laws of the report's folder."""

import dataclasses as dc
import json
import re

import pytest

from np_drake.diagnosis.report.diagnosis_page import figures, write_report
from np_drake.vehicle import Vehicle
from np_drake.vehicle.rotor_layout import rotor_names

HOSTILE = '<script>alert("x")</script>&$\\frac{$ 飞.csv'


@pytest.fixture(scope="module")
def folder(diagnosis, tmp_path_factory):
    path = tmp_path_factory.mktemp("report")
    write_report(diagnosis, path, seed=7, config={"train": ["a.csv"]})
    return path


def test_the_folder_holds_page_data_and_pictures(folder):
    pictures = {f"{name}.png" for name in ("regimes", "replay")}
    assert {path.name for path in folder.iterdir()} == {"report.html", "diagnosis.json", *pictures}


def test_the_data_begin_as_every_file_of_the_project(folder):
    content = json.loads((folder / "diagnosis.json").read_text())
    assert content["schema"] == "np_drake.diagnosis/1"
    assert (content["seed"], content["config"]) == (7, {"train": ["a.csv"]})
    assert content["version"].count(".") == 2
    assert content["verdict"] == ["suspended_payload", "linear_drag"]


def test_the_page_stands_alone(folder):
    page = (folder / "report.html").read_text()
    assert re.findall(r"(?:src|href)\s*=\s*(.{6})", page) == ['"data:'] * 2
    assert "url(" not in page
    assert "<script" not in page
    assert page.count("data:image/png;base64,") == 2


def test_every_number_of_the_figures_can_be_read(diagnosis, smallest_text):
    vehicle = Vehicle()
    rotors = rotor_names(vehicle.rotor_positions, [[f"PX4 motor {n}" for n in (3, 1, 4, 2)]])
    weak = dc.replace(diagnosis.causes[0], rotor=rotors[0])
    found = figures(dc.replace(diagnosis, nominal=vehicle, rotors=tuple(rotors), causes=(weak,)))
    assert all(smallest_text(figure) >= 9.0 for figure in found.values())  # [px]
    (ax,) = found["rotors"].get_axes()
    bold = [text.get_text() for text in ax.texts if text.get_weight() == "bold"]
    assert bold == ["1", "PX4 motor 3"]


def test_hostile_names_are_text(diagnosis, tmp_path):
    causes = (dc.replace(diagnosis.causes[0], onset={HOSTILE: 3.0}),)
    dut = dc.replace(
        diagnosis,
        vehicle=HOSTILE,
        train=(HOSTILE,),
        held_out=(HOSTILE,),
        causes=causes,
        warnings=(HOSTILE,),
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
