"""Laws of `np-drake reproduce models`."""

import json
import shutil

from diagrams.cli.main import run
from diagrams.loop.controller_config import FILTER_MODEL, NP_MODEL


def test_both_files_are_written_under_the_packaged_names(tmp_path, monkeypatch, capsys):
    def made(run):
        return [
            shutil.copy(packaged, run.folder / packaged.name)
            for packaged in (NP_MODEL, FILTER_MODEL)
        ]

    monkeypatch.setattr("diagrams.tracking.packaged.make_packaged_models", made)
    out = tmp_path / "models"
    assert run(["reproduce", "models", "--out", str(out), "--json", str(tmp_path / "m.json")]) == 0
    assert {path.name for path in out.iterdir()} >= {NP_MODEL.name, FILTER_MODEL.name}
    lines = json.loads((tmp_path / "m.json").read_text())["models"]
    assert [(line["relative"], line["from_zero"]) for line in lines] == [(0, 0), (0, 0)]
    assert "neural_predictor.safetensors" in capsys.readouterr().out
