"""Laws of flights with a rope that has mass."""

import dataclasses as dc
import json

import pytest

from diagrams.cli.fly import FlyOptions, scenarios
from diagrams.cli.main import run
from diagrams.loop.experiments import load_experiment
from diagrams.loop.flight_result import fly
from np_drake.logs.formats.log_file import write_log
from systems.payload_config import PayloadConfig

ROPE = PayloadConfig(mass=0.26, length=0.8, rope_mass=0.1, segments=3, stiffness=2e3, damping=12.0)


def flight(seed, *, kind="hold", **reference):
    """Return a flight of 12 s on a multisine with the rope."""
    config = load_experiment("multisine")
    config.duration, config.reference.seed = 12.0, seed
    config.controller.kind, config.controller.solver = kind, "sqp"
    config.reality.payload = ROPE
    return config.check_and_step()


def test_a_rope_is_carried_and_followed_by_the_step():
    with_rope, without = flight(1), flight(1)
    without.reality.payload = dc.replace(ROPE, rope_mass=0.0)
    assert with_rope.carried_mass - without.carried_mass == pytest.approx(0.1)
    # the fastest of 2 n sqrt(k/M) of a chain, and below it by Gershgorin's bound
    fastest = 2 * 3 * (2e3 / 0.1) ** 0.5
    assert 0.75 * 1.7 / fastest < with_rope.largest_step < 1.7 / fastest
    assert without.largest_step > 2 * with_rope.largest_step


def test_the_oracle_does_not_know_a_rope():
    with pytest.raises(ValueError, match="the oracle knows a cable without mass"):
        flight(1, kind="oracle")


def test_a_rope_of_negative_mass_is_one_line(capsys):
    assert run(["fly", "hover", "--set", "reality.payload.rope_mass=-1"]) == 2
    assert "rope_mass must be" in capsys.readouterr().err.splitlines()[-1]


STEP = "simulator.max_step_size"


def test_fields_of_the_command_line_come_before_the_check_of_the_step(tmp_path, caplog):
    path = tmp_path / "r.yaml"
    text = "reality: {payload: {rope_mass: 0.05, segments: 5}}\nsimulator: {max_step_size: 0.004}"
    path.write_text(text)
    with pytest.raises(ValueError, match=rf"r.yaml: not a scenario file: .*{STEP} must be at most"):
        scenarios(FlyOptions(str(path)))
    with pytest.raises(ValueError, match=f"{STEP} must be at most"):
        scenarios(FlyOptions(str(path), fields=["reference.speed=1"]))
    (mended,) = scenarios(FlyOptions(str(path), fields=[f"{STEP}=0.0001"]))
    assert mended.simulator.max_step_size == 0.0001
    with pytest.raises(ValueError, match=f"{STEP} must be at most"):
        scenarios(FlyOptions("circle", fields=["reality.payload.rope_mass=0.05", f"{STEP}=0.004"]))
    assert not caplog.records
    (slow,) = scenarios(FlyOptions("circle", fields=["reality.payload.rope_mass=0.05"]))
    assert f"{STEP} becomes {slow.simulator.max_step_size:.2g} s" in caplog.text


def test_the_parts_of_a_rope_weigh_what_it_weighs():
    payload, riding = None, 0.0
    for effect in flight(1).reality.everything():
        payload = effect if effect.identifier == "suspended_payload" else payload
        riding += effect.delta_mass if effect.identifier == "mass_error" else 0.0
    assert payload.mass + riding == pytest.approx(0.36)
    assert (payload.mass, payload.length) == pytest.approx(ROPE.pendulum)


@pytest.mark.nightly
def test_diagnose_says_a_payload_of_the_effective_mass_and_length(tmp_path):
    words = []
    for seed in (1, 2, 3):
        file = tmp_path / f"flight_{seed}.csv"
        write_log(fly(flight(seed), seed=seed).log(), file)
        words += ["--held-out" if seed == 3 else "--train", str(file)]
    out = tmp_path / "report"
    assert run(["diagnose", *words, "--vehicle", "paper", "--out", str(out)]) == 0
    causes = json.loads((out / "diagnosis.json").read_text())["causes"]
    (found,) = [c["parameters"] for c in causes if c["effect"] == "suspended_payload"]
    mass, length = ROPE.pendulum
    assert found["mass"]["value"] == pytest.approx(mass, rel=0.08)
    assert found["length"]["value"] == pytest.approx(length, rel=0.04)
    assert length < 0.95 * ROPE.length
