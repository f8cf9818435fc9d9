"""An effect is one file and one registration, and no other file names it."""

import ast
import importlib
from pathlib import Path
from unittest import mock

import numpy as np

import np_drake.diagnosis
from diagrams.evidence.challenge.case import draw_effect
from diagrams.exports.formats import FORMATS
from diagrams.gap.corrected import FILE, corrected_simulator, write_corrected
from diagrams.loop.flight import FlightConfig, load_flight
from diagrams.loop.flight_result import fly
from diagrams.loop.reality import RealityConfig
from np_drake.diagnosis.diagnose import diagnose
from np_drake.diagnosis.report.diagnosis_page import PAGE, write_report
from np_drake.effects.effect_entry import EffectEntry
from np_drake.effects.library import LIBRARY, MEASURED_ROTORS, NUISANCES, SIMULATED
from np_drake.references.config import ReferenceConfig
from systems.payload_config import PayloadConfig

CORD = '''"""Effect `elastic_cord`: a cord from the origin of the world to the vehicle."""

import dataclasses as dc
from typing import ClassVar

import numpy as np

from np_drake.effects.base import Motion, Parameter, WrenchEffect
from np_drake.effects.library import register
from np_drake.vehicle import Vehicle


@register
@dc.dataclass(frozen=True)
class ElasticCord(WrenchEffect):
    """Force -stiffness p_WB at Bo."""

    stiffness: float = 0.5  # [N/m]

    identifier: ClassVar[str] = "elastic_cord"
    named: ClassVar[str] = "an elastic cord"
    phrase: ClassVar[str] = "a cord that pulls with {stiffness}"
    bench_check: ClassVar[str] = "look for what holds the vehicle"
    excited_by: ClassVar[str] = "level flight to all corners of the room"
    turns: ClassVar[bool] = False
    parameters: ClassVar[tuple[Parameter, ...]] = (Parameter("stiffness", "N/m", 0.0, 0.0, 5.0, 0.5),)

    def wrench(self, vehicle: Vehicle, motion: Motion) -> np.ndarray:
        force = -self.stiffness * motion.x[..., 0:3]
        return np.concatenate([force, np.zeros_like(force)], axis=-1)
'''  # noqa: E501
# Of the library's identifiers in the diagnosis, which asks the effects themselves.
MOST_STRINGS = 20


def flown(entry, track, speed, seed):
    """Return the log of a short flight in Drake with this effect and no other."""
    reality = RealityConfig(
        PayloadConfig(tether="none"),
        rotor_drag=0.0,
        motor_lag=0.0,
        thrust_scale=1.0,
        effects=[entry],
    )
    reference = ReferenceConfig(track, speed=speed, ramp=3.0, dither=[0.08, 0.08, 0.08])
    config = FlightConfig(name=track, duration=6.0, reality=reality, reference=reference)
    config.controller.kind = "cascade"
    return fly(config, seed=seed).log()


def test_a_new_effect_is_simulated_found_reported_corrected_and_exported(tmp_path, monkeypatch):
    package = tmp_path / "cord_package"
    package.mkdir()
    (package / "__init__.py").touch()
    (package / "elastic_cord.py").write_text(CORD)
    monkeypatch.syspath_prepend(tmp_path)
    with mock.patch.dict(LIBRARY):
        cord = importlib.import_module("cord_package.elastic_cord").ElasticCord
        vehicle = FlightConfig().vehicle
        (drawn,) = draw_effect("elastic_cord", np.random.default_rng(0), vehicle, 20.0)
        assert 0.0 < drawn.stiffness <= 5.0

        entry = EffectEntry("elastic_cord", {"stiffness": 0.5})
        found = diagnose(
            [flown(entry, "circle", 1.5, 0)], [flown(entry, "lemniscate", 2.0, 1)], vehicle
        )
        assert [cause.identifier for cause in found.causes] == ["elastic_cord"]
        stiffness = found.causes[0].parameters["stiffness"]
        assert stiffness.ci95[0] <= 0.5 <= stiffness.ci95[1]  # [N/m]
        assert abs(stiffness.value - 0.5) < 0.1

        write_report(found, tmp_path)
        page = (tmp_path / PAGE).read_text()
        for words in ("a cord that pulls with", "look for what holds the vehicle"):
            assert words in page.lower()

        write_corrected(corrected_simulator(found, vehicle), found, tmp_path / FILE)
        corrected = load_flight(str(tmp_path / FILE))
        assert any(isinstance(effect, cord) for effect in corrected.reality.added)
        corrected.duration = 0.5
        corrected.controller.kind = "cascade"
        assert np.isfinite(fly(corrected, seed=0).log().x).all()

        for form in FORMATS.values():
            account = form.write(vehicle, corrected.reality.added, tmp_path / "exported")
            assert "elastic_cord" in [line.identifier for line in account]


def test_the_diagnosis_asks_the_effects_and_seldom_names_one():
    known = {*LIBRARY, *MEASURED_ROTORS, *SIMULATED, *NUISANCES}
    strings = [
        f"{path.name}:{node.lineno}"
        for path in Path(np_drake.diagnosis.__file__).parent.rglob("*.py")
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(node, ast.Constant) and node.value in known
    ]
    assert len(strings) <= MOST_STRINGS, strings
