"""Laws of the tracking table's rows."""

import json
from types import SimpleNamespace

from diagrams.loop.flight import FlightConfig
from diagrams.tracking.study import _notes
from diagrams.tracking.tracking import ROWS


def test_the_settings_of_every_row_that_is_trained_are_said_and_written():
    run = SimpleNamespace(seed=3, seeds=[4], solver="sqp", settings={"seeds": [4]})
    notes, config = _notes(ROWS, run, "both", FlightConfig())
    trained = {row.configuration for row in ROWS if row.configuration}
    assert set(config["configurations"]) == trained
    assert all(any(note.startswith(f"{name}: ") for note in notes) for name in trained)
    json.dumps(config["configurations"])
