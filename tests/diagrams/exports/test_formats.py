"""The account of an export leaves no effect out in silence and says what the file shows."""

import pytest

from diagrams.exports.formats import FORMATS, LEFT_OUT, carried
from np_drake import effects as fx
from np_drake.effects.library import LIBRARY, effects_for
from np_drake.vehicle.vehicle import Vehicle

EFFECTS = effects_for("rotor_speed", neighbours=True)
UNUSUAL = {"thrust_drift": {"start": 0.9}}  # whose usual start is that of the nominal model


class Hose(fx.LinearDrag):
    """A user's own effect."""

    identifier = "hose"


@pytest.mark.parametrize("form", FORMATS)
@pytest.mark.parametrize("identifier", EFFECTS)
def test_the_file_shows_an_effect_exactly_where_the_account_does(form, identifier, tmp_path):
    effect = EFFECTS[identifier](**UNUSUAL.get(identifier, {}))
    beside = [] if identifier == "linear_drag" else [fx.LinearDrag()]  # through which a wind acts

    def written(effects):
        account = FORMATS[form].write(Vehicle(), effects, tmp_path / "dut")
        return account, (tmp_path / "dut").read_text()

    account, text = written([*beside, effect])
    assert (text != written(beside)[1]) == (account[len(beside)].how != LEFT_OUT)


@pytest.mark.parametrize("form", FORMATS)
def test_the_account_has_a_line_with_a_reason_for_every_effect(form, tmp_path):
    effects = [effect() for effect in EFFECTS.values()]
    effects += [fx.SensorNoise(), fx.BatterySag(), Hose()]
    account = FORMATS[form].write(Vehicle(), effects, tmp_path / "dut")
    assert [line.identifier for line in account][: len(effects)] == [e.identifier for e in effects]
    assert all(line.note for line in account)
    assert account[len(effects) - 1].how == LEFT_OUT  # the user's own
    (line,) = carried([fx.SensorNoise()], {"mass_error": ("exact", "mass")})
    assert (line.how, line.note) == (LEFT_OUT, "an error of the sensors, not of the motion")


@pytest.mark.parametrize("form", FORMATS)
@pytest.mark.parametrize(
    "effects, reason",
    [
        ([fx.MotorLag(), fx.MotorLag()], "one motor_lag at most"),
        ([fx.SuspendedPayload(), fx.SuspendedPayload()], "one suspended_payload at most"),
        ([fx.ThrustScale(0.0)], "scale of thrust must be positive"),
        ([LIBRARY["mass_error"](-3.0)], "leave a rigid body"),
        ([LIBRARY["inertia_error"](scale_zz=3.0)], "leave a rigid body"),
    ],
)
def test_an_impossible_vehicle_is_refused_and_nothing_is_written(form, effects, reason, tmp_path):
    with pytest.raises(ValueError, match=reason) as error:
        FORMATS[form].write(Vehicle(), effects, tmp_path / "dut")
    assert "\n" not in str(error.value)
    assert not (tmp_path / "dut").exists()
