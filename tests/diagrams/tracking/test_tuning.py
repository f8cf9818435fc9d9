from diagrams.loop.experiments import load_experiment
from diagrams.tracking import tuning


def test_the_best_row_has_the_least_error_among_those_within_the_effort(monkeypatch, in_this_process):
    def load(name):
        config = load_experiment(name)
        config.reference.ramp = 3.0
        return config

    monkeypatch.setattr(tuning, "load_experiment", load)
    seen = []
    lines = tuning.weight_table(
        seed=1,
        duration=1.0,
        position=(0.1, 1.0),
        torque=(0.01, 1.0),
        on_progress=lambda done, total: seen.append((done, total)),
    )
    assert seen[-1] == (4, 4)
    allowed = [line for line in lines if line["allowed"]]
    assert lines[0] == min(allowed, key=lambda line: line["E_xy"])
    assert all(line["torque_rms"] > tuning.EFFORT for line in lines if not line["allowed"])
