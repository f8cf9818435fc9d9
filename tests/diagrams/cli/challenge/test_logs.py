"""Laws of `np-drake challenge logs`: parts by name, and the tables and metrics of what was asked; stand-ins answer."""

import json

from diagrams.challenge.imported import conventions, round_trip, thinned
from diagrams.cli.main import run


def test_an_unknown_part_is_refused(capsys):
    assert run(["challenge", "logs", "--only", "all"]) != 0
    assert "--only must be of thinned, conventions, round-trip; got 'all'" in capsys.readouterr().err


def test_every_part_has_a_table_and_its_values(monkeypatch, tmp_path, capsys):
    case = thinned.ThinnedCase(0, "drake", "clean", 2, (), ("clock_offset",))
    log = conventions.WrongLog(("world NED",), "circle", "named rightly", "fits world: ned", True)
    trip = round_trip.RoundTrip(
        *("linear_drag", "command", "NED/FRD", 50, "sampled", ("linear_drag",), ("linear_drag",)),
        names=True,
        inside=False,
        outside={"linear_drag.d_x": (3.0, 1.0, 2.0)},
    )
    monkeypatch.setattr(thinned, "answer_thinned", lambda *_, **how: [case])
    monkeypatch.setattr(conventions, "answer_conventions", lambda *_, **how: [log])
    monkeypatch.setattr(round_trip, "answer_round_trips", lambda **how: [trip])
    metrics, table = tmp_path / "m.json", tmp_path / "t.md"
    assert run(["challenge", "logs", "--json", str(metrics), "--markdown", str(table)]) == 0
    printed, written = table.read_text(), json.loads(metrics.read_text())
    assert "| as it is | 3 | 1 | 0 | 0 |" in printed
    assert "| without detection of timing | 3 | 1 | 1 | 0 |" in printed
    assert "| one | 1 | 1 | 0 | 0 | 0 | 0 | 1 |" in printed
    assert "| linear_drag | command | NED/FRD | 50 | sampled | yes | linear_drag.d_x |" in printed
    assert "seed 3700" in printed
    assert [written[part][0] for part in ("thinned", "conventions", "round-trip")] == [
        json.loads(json.dumps(answer.row())) for answer in (case, log, trip)
    ]
