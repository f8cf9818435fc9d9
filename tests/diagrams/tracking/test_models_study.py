"""Laws of `np-drake reproduce models`."""

import json
import shutil

from diagrams.cli.main import run
from diagrams.loop.controllers import DEFAULT_MODEL, FLYING_MODEL


def test_both_files_are_written_under_the_packaged_names(tmp_path, monkeypatch, capsys):
    def made(folder, *, on_step):
        return [shutil.copy(packaged, folder / packaged.name) for packaged in (DEFAULT_MODEL, FLYING_MODEL)]

    monkeypatch.setattr("diagrams.tracking.packaged.make_packaged_models", made)
    out = tmp_path / "models"
    assert run(["reproduce", "models", "--out", str(out), "--json", str(tmp_path / "m.json")]) == 0
    assert {path.name for path in out.iterdir()} >= {DEFAULT_MODEL.name, FLYING_MODEL.name}
    lines = json.loads((tmp_path / "m.json").read_text())["models"]
    assert [(line["relative"], line["from_zero"]) for line in lines] == [(0, 0), (0, 0)]
    assert "default.safetensors" in capsys.readouterr().out
