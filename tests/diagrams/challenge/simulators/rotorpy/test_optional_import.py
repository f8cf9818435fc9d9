from importlib import util

import pytest

from diagrams.challenge.generate.make import make, simulators
from diagrams.challenge.simulators.rotorpy import optional_import


def test_the_simulator_is_offered():
    assert set(simulators()) == {"drake", "rotorpy"}


def test_without_the_package_the_remedy_is_said_before_any_work(tmp_path, monkeypatch):
    monkeypatch.setattr(optional_import, "find_spec", lambda name: None)
    with pytest.raises(ValueError, match=r"pip install 'np_drake\[challenge\]'"):
        make(
            tmp_path / "cases",
            tmp_path / "truth",
            simulator="rotorpy",
            cases=1,
            clean=0,
            seconds=5.0,
        )
    assert list(tmp_path.iterdir()) == []


@pytest.mark.skipif(util.find_spec("rotorpy") is None, reason="rotorpy is not installed")
def test_a_set_is_flown_and_names_its_simulator(tmp_path):
    out, truth = tmp_path / "cases", tmp_path / "truth"
    make(out, truth, simulator="rotorpy", quality="real", cases=1, clean=0, seconds=5.0, seed=2)
    (file,) = truth.glob("*/truth.json")
    assert '"simulator": "rotorpy"' in file.read_text(encoding="utf-8")
    assert len(list(out.glob("*/*.csv"))) == 3


def test_without_the_package_no_foreign_vehicle_and_one_clear_line(monkeypatch):
    monkeypatch.setattr(optional_import, "find_spec", lambda name: None)
    with pytest.raises(ValueError, match=r"pip install 'np_drake\[challenge\]'") as caught:
        optional_import.foreign_vehicle(own=True)
    assert "\n" not in str(caught.value)
