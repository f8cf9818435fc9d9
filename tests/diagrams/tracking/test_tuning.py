from contextlib import contextmanager

from diagrams.batch.run import Run
from diagrams.loop.experiments import load_experiment
from diagrams.tracking import tuning


def test_the_best_row_has_the_least_error_among_those_within_the_effort(
    monkeypatch, in_this_process
):
    def load(name):
        config = load_experiment(name)
        config.reference.ramp = 3.0
        return config

    monkeypatch.setattr(tuning, "load_experiment", load)
    seen = []

    @contextmanager
    def bar(title, total):
        yield lambda done, text="": seen.append(text)

    run = Run(1, bar=bar)
    lines = tuning.weight_table(run, duration=1.0, position=(0.1, 1.0), torque=(0.01, 1.0))
    assert seen[-1] == "4 of 4"
    allowed = [line for line in lines if line["allowed"]]
    assert lines[0] == min(allowed, key=lambda line: line["E_xy"])
    assert all(line["torque_rms"] > tuning.EFFORT for line in lines if not line["allowed"])
