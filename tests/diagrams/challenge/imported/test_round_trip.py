"""Logs of other origin: in wrong conventions refused by name, and imported diagnosed as their
original.
"""

import dataclasses as dc
import itertools
from functools import partial

import numpy as np
import pytest
import yaml

from diagrams.challenge import flight
from diagrams.challenge.draw import VEHICLES
from diagrams.challenge.plans import draw_plan
from diagrams.challenge.sensors import SensorQuality, rows_of, with_sensor_noise
from np_drake.diagnosis.diagnose import diagnose
from np_drake.effects.library import LIBRARY
from np_drake.logs.formats.log_file import write_log
from np_drake.logs.import_sheet import write_sheet
from np_drake.logs.importing.conventions import WrongConventions, changed
from np_drake.logs.importing.import_log import import_log
from np_drake.logs.importing.log_map import convert, load_map_file
from np_drake.logs.opening import VEHICLE, open_case
from np_drake.vehicle.text import vehicle_text
from tests.diagrams.challenge.imported import written as table

# The laws hold from any start; a settled one only takes longer.
fly = partial(flight.fly, warm_up=0.5)  # [s]

ERRORS = {  # by name: how the log is written, where its map declares the defaults
    "world NED": (("world", "ned"),),
    "body FRD": (("body", "frd"),),
    "consistent NED/FRD": (("world", "ned"), ("body", "frd")),
    "quaternion xyzw": (("attitude.order", "xyzw"),),
    "quaternion world to body": (("attitude.direction", "world_to_body"),),
    "rates in deg/s": (("rates.unit", "deg/s"),),
    "rates in FRD": (("rates.body", "frd"),),
    "accelerometer in g": (("acceleration.unit", "g"),),
    "accelerometer without gravity": (
        ("acceleration.kind", "acceleration"),
        ("acceleration.axes", "body"),
    ),
    "accelerometer negative": (("acceleration.scale", -1.0),),
    "thrust negative": (("thrust.scale", -1.0),),
    "velocity in body axes": (("velocity.axes", "body"),),
    "position in mm": (("position.unit", "mm"),),
    "position and velocity in NED": (("position.world", "ned"), ("velocity.world", "ned")),
    "time in ms": (("time.unit", "ms"),),
}
PAIRS = (("world NED", "quaternion xyzw"), ("rates in deg/s", "thrust negative"))
FLIGHTS = {"train_1": "aggressive_multisine", "train_2": "waypoints", "heldout_1": "lemniscate"}
EFFECTS = {  # well visible on a vehicle of this mass [kg]; own choice
    "linear_drag": lambda mass: {"d_x": 0.25 * mass, "d_y": 0.2 * mass, "d_z": 0.15 * mass},
    "thrust_scale": lambda mass: {"scale": 0.9},
}


@pytest.fixture(scope="module")
def flown():
    """Vehicle, and a flight of 15 s with drag and wind, at 100 Hz."""
    rng = np.random.default_rng([3700, 1, 0, 0])
    vehicle = dc.replace(VEHICLES[rng.integers(len(VEHICLES))], command_timing="held")
    effects = [
        LIBRARY["linear_drag"].of(EFFECTS["linear_drag"](vehicle.mass)),
        LIBRARY["constant_wind"].of({"x": 1.5, "y": -1.0, "z": 0.0}),
    ]
    plan = draw_plan(rng, vehicle, 15.0, "aggressive_multisine")
    log = fly(vehicle, plan, effects, t=np.arange(1500) / 100.0)
    return with_sensor_noise(log, vehicle, SensorQuality(), rng)


def written(log, errors, path):
    """Write the log in conventions of its own; return its quantities, the default map, and the one
    that fits.
    """
    x = {name: values for name, values in table.quantities_of(log).items() if name != "rotor_speed"}
    declared = table.default_map(list(x), command="held_after")
    own = changed(declared, tuple(itertools.chain(*(ERRORS[name] for name in errors))))
    table.write_table(path, log.t, table.columns_in(x, own), own)
    return x, declared, own


@pytest.mark.parametrize("errors", [*((name,) for name in ERRORS), *PAIRS], ids=" and ".join)
def test_a_log_in_other_conventions_is_refused_under_the_right_name(errors, flown, tmp_path):
    x, declared, own = written(flown, errors, tmp_path / "flight.csv")
    with pytest.raises(WrongConventions) as refused:
        import_log(tmp_path / "flight.csv", declared)
    named = changed(declared, refused.value.verdict.changes)
    assert (named.time.unit or "s") == (own.time.unit or "s")
    found = convert(table.columns_in(x, own), named)
    found["attitude"] *= np.sign(np.sum(found["attitude"] * x["attitude"], axis=1, keepdims=True))
    for name, values in x.items():
        assert np.allclose(
            found[name], values, rtol=0, atol=1e-4 * max(1.0, np.abs(values).max())
        ), name
    assert import_log(tmp_path / "flight.csv", own).flights


def diagnosed(folder, vehicle):
    (folder / VEHICLE).write_text(vehicle_text(vehicle), encoding="utf-8")
    return diagnose(*open_case(folder))


@pytest.mark.parametrize("effect, finer", [("linear_drag", 1), ("thrust_scale", 2)])
def test_an_imported_log_is_diagnosed_as_its_original(effect, finer, tmp_path):
    """Also of a log whose rows hold the mean of `finer` commands."""
    rng, rate = np.random.default_rng([3700, 2, 100]), 100 * finer
    semantics = "held_after" if finer == 1 else "averaged"
    vehicle = dc.replace(VEHICLES[rng.integers(len(VEHICLES))], command_timing="unknown")
    acting = LIBRARY[effect].of(EFFECTS[effect](vehicle.mass))
    folders = [tmp_path / "original", tmp_path / "imported"]
    for folder in folders:
        folder.mkdir()
    for name, kind in FLIGHTS.items():
        plan = draw_plan(rng, vehicle, 12.0, kind)
        exact = fly(vehicle, plan, [acting], t=np.arange(12 * rate) / rate)
        log = dc.replace(
            with_sensor_noise(exact, vehicle, SensorQuality(), rng), al=None, rotor=None
        )
        write_log(log, folders[0] / f"{name}.csv")
        u = log.u.reshape(-1, finer, 4).mean(axis=1)
        log = dc.replace(rows_of(log, np.arange(0, len(log), finer)), u=u)
        x = table.quantities_of(log)
        own = table.default_map(list(x), world="ned", body="frd", command=semantics)
        table.write_table(tmp_path / f"{name}.csv", log.t, table.columns_in(x, own), own)
        text = {key: getattr(own, key) for key in ("world", "body", "command")}
        text |= {"time": {"columns": own.time.columns}}
        text |= {key: {"columns": source.columns} for key, source in own.sources()}
        (tmp_path / "map.yaml").write_text(yaml.safe_dump(text), encoding="utf-8")
        found = import_log(tmp_path / f"{name}.csv", load_map_file(tmp_path / "map.yaml").values)
        write_log(found.flights[0], folders[1] / f"{name}.csv")
        write_sheet(found.sheet, folders[1] / f"{name}.csv")
    original, imported = (diagnosed(folder, vehicle) for folder in folders)
    assert original.verdict == (effect,)
    (told,) = imported.causes
    if (
        told.identifier != effect
    ):  # of a vehicle that nobody measured, less thrust looks as more mass does
        assert effect in told.indistinguishable_from
        return
    for name, estimate in original.causes[0].parameters.items():
        low, high = told.parameters[name].ci95  # wider: the vehicle of an imported log may differ
        assert low <= estimate.value <= high, name
