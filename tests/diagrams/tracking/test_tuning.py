from contextlib import contextmanager

from diagrams.batch.run import Run
from diagrams.tracking import tuning


def test_the_best_row_has_the_least_error_among_those_within_the_effort(monkeypatch, in_this_process):
    monkeypatch.setattr(tuning, "POSITION", (0.1, 1.0))
    monkeypatch.setattr(tuning, "TORQUE", (0.01, 1.0))
    seen = []

    @contextmanager
    def bar(title, total):
        yield lambda done, text="": seen.append(text)

    lines = tuning.weight_table(Run(1, bar=bar), duration=1.0)
    assert seen[-1] == "4 of 4"
    allowed = [line for line in lines if line["allowed"]]
    assert lines[0] == min(allowed, key=lambda line: line["E_xy"])
    assert all(line["torque_rms"] > tuning.EFFORT for line in lines if not line["allowed"])
