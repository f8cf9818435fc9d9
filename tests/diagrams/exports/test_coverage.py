"""The account of an export: no effect is left out in silence, and what it says is what the file
shows.
"""

import dataclasses as dc
import math
from pathlib import Path
from typing import ClassVar

import pytest

from diagrams.exports.carried import EXACT, LEFT_OUT, carried, how_carried
from diagrams.exports.coverage import FORMATS, coverage
from np_drake.effects.base import Parameter, SensorEffect, WrenchEffect
from np_drake.effects.battery_sag import BatterySag
from np_drake.effects.library import LIBRARY, effects_for
from np_drake.effects.linear_drag import LinearDrag
from np_drake.effects.motor_lag import MotorLag
from np_drake.effects.sensor_noise import SensorNoise
from np_drake.effects.suspended_payload import SuspendedPayload
from np_drake.effects.thrust_scale import ThrustScale
from np_drake.vehicle.vehicle import Vehicle, load_vehicle, preset_names

EFFECTS = effects_for("rotor_speed", neighbours=True)
UNUSUAL = {"thrust_drift": {"start": 0.9}}  # whose usual start is that of the nominal model
PAGE = Path(__file__).parents[3] / "docs" / "guide" / "export.md"


@dc.dataclass(frozen=True)
class Hose(WrenchEffect):
    """A user's own effect."""

    weight: float = 0.8  # [N/m]

    identifier: ClassVar[str] = "hose"
    parameters: ClassVar[tuple[Parameter, ...]] = (Parameter("weight", "N/m", 0.0, 0.0, 5.0, 0.5),)


def written(form, effects, folder) -> str:
    FORMATS[form].write(Vehicle(), effects, folder / "dut")
    return (folder / "dut").read_text()


@pytest.mark.parametrize("form", FORMATS)
@pytest.mark.parametrize("identifier", EFFECTS)
def test_the_file_shows_an_effect_exactly_where_the_account_does(form, identifier, tmp_path):
    effect = EFFECTS[identifier](**UNUSUAL.get(identifier, {}))
    beside = [] if identifier == "linear_drag" else [LinearDrag()]  # through which a wind acts
    shown = written(form, [*beside, effect], tmp_path) != written(form, beside, tmp_path)
    (account,) = FORMATS[form].write(Vehicle(), [effect], tmp_path / "dut")[:1]
    assert shown == (account.how != LEFT_OUT)


@pytest.mark.parametrize("form", FORMATS)
def test_the_account_has_a_line_with_a_reason_for_every_effect(form, tmp_path):
    effects = [effect() for effect in EFFECTS.values()] + [SensorNoise(), BatterySag(), Hose()]
    account = FORMATS[form].write(Vehicle(), effects, tmp_path / "dut")
    assert [line.identifier for line in account][: len(effects)] == [e.identifier for e in effects]
    assert all(line.note for line in account)
    assert account[len(effects) - 1].how == LEFT_OUT  # the user's own


@pytest.mark.parametrize("form", FORMATS)
def test_a_format_has_a_word_for_every_effect_of_the_motion_and_no_other(form):
    moving = [effect for effect in EFFECTS.values() if not issubclass(effect, SensorEffect)]
    law = FORMATS[form].law
    assert all(effect.identifier in law or effect.place in law for effect in moving)
    assert law.keys() <= {effect.identifier for effect in moving} | {"mass", "uneven_lag"}


@pytest.mark.parametrize("form", FORMATS)
@pytest.mark.parametrize("preset", preset_names())
def test_every_preset_is_written_with_every_single_effect(form, preset, tmp_path):
    vehicle = load_vehicle(preset)
    for effect in (
        MotorLag(0.02),
        ThrustScale(0.9),
        SuspendedPayload(mass=0.05 * vehicle.mass, length=0.5),
    ):
        FORMATS[form].write(vehicle, [effect], tmp_path / "dut")


@pytest.mark.parametrize("form", FORMATS)
@pytest.mark.parametrize(
    "effects, reason",
    [
        ([MotorLag(), MotorLag()], "one motor_lag at most"),
        ([SuspendedPayload(), SuspendedPayload()], "one suspended_payload at most"),
        ([ThrustScale(0.0)], "scale of thrust must be positive"),
        ([LIBRARY["mass_error"](-3.0)], "leave a rigid body"),
        ([LIBRARY["inertia_error"](scale_zz=3.0)], "leave a rigid body"),
        (["drag"], "an effect must be of a class"),
    ],
)
def test_an_impossible_vehicle_is_refused_and_nothing_is_written(form, effects, reason, tmp_path):
    with pytest.raises(ValueError, match=reason) as error:
        FORMATS[form].write(Vehicle(), effects, tmp_path / "dut")
    assert "\n" not in str(error.value)
    assert not (tmp_path / "dut").exists()


def test_a_rotor_that_gives_nothing_is_written(tmp_path):
    for form in FORMATS:
        FORMATS[form].write(Vehicle(), [LIBRARY["weak_rotor"](2, 0.0)], tmp_path / "dut")


def test_a_law_of_the_sensors_is_said():
    (line,) = carried([SensorNoise()], {"mass_error": (EXACT, "mass")})
    assert (line.how, line.note) == (LEFT_OUT, "an error of the sensors, not of the motion")


def test_the_page_of_the_site_shows_the_table_of_the_code():
    header, rows = coverage()
    assert len(header) == 1 + len(FORMATS)
    sensors = [effect for effect in EFFECTS.values() if issubclass(effect, SensorEffect)]
    assert len(rows) == len(EFFECTS) - len(sensors)
    for form in FORMATS.values():  # as the page says of them in words
        assert {how_carried(effect, form.law)[0] for effect in sensors} == {LEFT_OUT}
    assert "<!-- exports -->" in PAGE.read_text(
        encoding="utf-8"
    )  # where the site has `coverage_markdown`


def test_two_drags_add_up_and_two_scales_multiply():
    from diagrams.exports.corrected import corrected

    dut = corrected(Vehicle(), [LinearDrag(0.1, 0.2, 0.3), LinearDrag(0.1, 0.2, 0.3)])
    assert dut.linear.tolist() == [0.2, 0.4, 0.6]
    assert math.isclose(corrected(Vehicle(), [ThrustScale(0.9), ThrustScale(0.8)]).scale, 0.72)
