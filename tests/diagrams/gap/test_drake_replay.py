"""Laws of the open-loop replay. The flights are made here, by hand, in Drake."""

import dataclasses as dc

import numpy as np
import pytest
from pydrake.systems.analysis import ApplySimulatorConfig, Simulator, SimulatorConfig

from diagrams.gap.drake_replay import DrakeReplay
from np_drake import attitude
from np_drake.effects.calibration import effects_of
from np_drake.effects.clock_offset import ClockOffset
from np_drake.effects.command_delay import CommandDelay
from np_drake.effects.downwash import Downwash
from np_drake.effects.gyro_bias import GyroBias
from np_drake.effects.linear_drag import LinearDrag
from np_drake.effects.mass_error import MassError
from np_drake.effects.motor_lag import MotorLag
from np_drake.effects.suspended_payload import SuspendedPayload
from np_drake.effects.thrust_scale import ThrustScale
from np_drake.flight_log import FlightLog
from np_drake.neighbour import Neighbour
from np_drake.vehicle import Vehicle
from np_drake.vehicle.calibration import Calibration
from systems.payload_config import PayloadConfig
from systems.plant import set_hover
from systems.tethered_quadrotor import make_tethered_quadrotor

VEHICLE = Vehicle()
STEP = 0.01  # of the logs [s]
# position after 1 s [m]: cubics through rates and velocities, integrators with other steps
EXACT = 1e-3
FINE = SimulatorConfig(
    integration_scheme="runge_kutta3", max_step_size=2e-3, use_error_control=False
)


class Flyer:
    """A vehicle under a simple attitude controller that follows a wandering acceleration."""

    def __init__(self, payload=None, **effects):
        self.payload = payload or PayloadConfig(tether="none")
        self.diagram = make_tethered_quadrotor(VEHICLE, self.payload, **effects)
        self.simulator = Simulator(self.diagram)
        ApplySimulatorConfig(FINE, self.simulator)
        self.context = self.simulator.get_mutable_context()
        self.plant = self.diagram.GetSubsystemByName("plant")
        self.plant_context = self.plant.GetMyMutableContextFromRoot(self.context)
        set_hover(self.plant, self.plant_context, self.payload, [0.0, 0.0, 2.0])

    @property
    def plant_state(self):
        return self.diagram.GetOutputPort("plant_state").Eval(self.context).copy()

    def fly(self, start, stop):
        """Rows [t, x, u, u that the rotors give, plant state] from start to stop [s]."""
        self.context.SetTime(start)
        self.simulator.Initialize()
        rows = []
        for k in range(round(start / STEP), round(stop / STEP)):
            x = self.diagram.GetOutputPort("x").Eval(self.context)
            u = self.command(k * STEP, x)
            self.diagram.GetInputPort("u").FixValue(self.context, u)
            thrust = self.diagram.GetOutputPort("rotor_thrust").Eval(self.context)
            rows.append(
                np.concatenate([[k * STEP], x, u, VEHICLE.mixer @ thrust, self.plant_state])
            )
            self.simulator.AdvanceTo((k + 1) * STEP)
        return rows

    def command(self, t, x):
        wander = 0.9 * np.sin(np.array([5.0, 7.0, 3.0]) * t + [0.0, 1.0, 2.0])
        force = VEHICLE.mass * (wander - x[7:10] - (x[:3] - [0, 0, 2.0]) + [0.0, 0.0, 9.81])
        R = attitude.rotation_matrix(x[3:7])
        error = np.cross(R[:, 2], force / np.linalg.norm(force)) @ R
        return VEHICLE.saturate(
            np.array([force @ R[:, 2], *(VEHICLE.J @ (80 * error - 15 * x[10:13]))])
        )


def log_of(rows):
    r = np.array(rows)
    return FlightLog(
        t=r[:, 0], p=r[:, 1:4], q=r[:, 4:8], v=r[:, 8:11], w=r[:, 11:14], u=r[:, 14:18], name="a"
    )


def position_error(log, *effects, **options):
    """Median after 1 s [m]."""
    return DrakeReplay(VEHICLE, starts=8, **options)([log], list(effects)).position[-1, 0]


@pytest.fixture(scope="module")
def nominal():
    return log_of(Flyer().fly(0.0, 4.0))


def test_a_flight_of_the_nominal_plant_replays_exactly(nominal):
    gap = DrakeReplay(VEHICLE)([nominal], [])
    assert gap.horizon == (0.1, 0.25, 0.5, 1.0)
    assert gap.starts == 24
    assert np.all(gap.position[-1] < EXACT)
    assert np.all(gap.velocity[-1] < 2e-3)  # [m/s]
    assert np.all(gap.attitude[-1] < 0.05)  # [deg]


@pytest.mark.parametrize(
    "places, effects",
    [
        ("wrench_effects", [LinearDrag(0.6, 0.6, 0.6)]),
        ("actuator_effects", [MotorLag(0.04), ThrustScale(0.95)]),
        ("actuator_effects", [CommandDelay(0.03)]),
        ("mass_effects", [MassError(0.1)]),
    ],
)
def test_a_known_effect_closes_the_gap(places, effects):
    log = log_of(Flyer(**{places: effects}).fly(0.0, 4.0))
    assert position_error(log) > 20 * EXACT
    assert position_error(log, *((effect, {"a": None}) for effect in effects)) < 2 * EXACT
    assert position_error(log, *((effect, {}) for effect in effects)) < 2 * EXACT  # on all flights


def test_a_downwash_is_that_of_the_neighbours_of_each_log():
    above = Neighbour(np.array([0.0, 9.0]), np.tile([0.3, 0.0, 3.5], (2, 1)))
    log = log_of(Flyer(wrench_effects=[Downwash(0.8, (above,))]).fly(0.0, 4.0))
    beside = dc.replace(log, neighbours=(above,))
    assert position_error(beside, (Downwash(0.8), {"a": None})) < 2 * EXACT
    assert position_error(log, (Downwash(0.8), {"a": None})) == position_error(log) > 20 * EXACT


def test_an_effect_acts_from_its_onset_on_and_only_on_its_flights():
    before, after = Flyer(), Flyer(actuator_effects=[ThrustScale(0.9)])
    rows = before.fly(0.0, 2.0)
    after.plant.SetPositionsAndVelocities(after.plant_context, before.plant_state)
    log = log_of(rows + after.fly(2.0, 4.0))
    effect = ThrustScale(0.9)
    assert position_error(log, (effect, {"a": 2.0})) < EXACT
    assert position_error(log, (effect, {"a": None})) > 50 * EXACT
    assert position_error(log, (effect, {"b": None})) == position_error(log)


def test_a_sensor_effect_is_taken_out_of_start_and_comparison(nominal):
    biased = dc.replace(nominal, w=nominal.w + [0.1, 0.0, 0.0])
    assert position_error(biased) > 50 * EXACT
    assert position_error(biased, (GyroBias(0.1, 0.0, 0.0), {})) < EXACT


def test_a_clock_offset_shifts_the_commands_against_the_state(nominal):
    # The state columns of row t are those of t + 0.03 s.
    shifted = dc.replace(nominal.rows(3, len(nominal)), t=nominal.t[:-3], u=nominal.u[:-3])
    assert position_error(shifted) > 5 * EXACT
    assert position_error(shifted, (ClockOffset(0.03), {})) < EXACT


def test_the_calibration_of_the_file_is_in_every_replay(nominal):
    known = Calibration(
        [0.005, 0.0, 0.0], [0.97, 1.01, 1.03, 0.99], clock_offset=0.01, command_delay=0.01
    ).check()
    log = nominal
    named = [(effect, {}) for effect in effects_of(known, VEHICLE)]
    for effects in ([], [(LinearDrag(0.1, 0.1, 0.1), {})]):
        dut = DrakeReplay(dc.replace(VEHICLE, calibration=known), starts=3)([log], effects)
        np.testing.assert_allclose(
            dut.position, DrakeReplay(VEHICLE, starts=3)([log], [*named, *effects]).position
        )


def test_a_payload_swings_where_it_is_said_to_swing():
    payload = PayloadConfig(mass=0.3, length=0.6)
    rows = Flyer(payload).fly(0.0, 4.0)
    log, plant = log_of(rows), np.array(rows)[:, 22:]
    hook = attitude.rotate(log.q, np.tile(payload.hook, (len(log), 1)))
    r = plant[:, 11:14] - log.p - hook
    r_rate = plant[:, 23:26] - log.v - np.cross(plant[:, 14:17], hook)
    effect = SuspendedPayload(0.3, 0.6, *payload.hook)
    nominal, seen = position_error(log), position_error(log, (effect, {"a": None}))
    known = position_error(log, (effect, {"a": None}), hidden={"a": (log.t, r, r_rate)})
    called = position_error(log, (effect, {"a": None}), hidden=lambda name: (log.t, r, r_rate))
    assert known == called < 5 * EXACT  # the attitude is unstable: small errors of the swing grow
    assert seen < 0.2 * nominal  # along the force that the log shows
    assert nominal > 50 * EXACT


def test_measured_rotor_speed_has_lagged_already():
    lagging = dc.replace(VEHICLE, rotor_time_constant=0.05)
    rows = Flyer(actuator_effects=[MotorLag(0.05)]).fly(0.0, 4.0)
    dut, log = DrakeReplay(lagging, starts=4), log_of(rows)
    measured = dc.replace(log, u=np.array(rows)[:, 18:22], input="rotor_speed")
    assert dut([log], []).position[-1, 0] < 2 * EXACT
    assert (
        dut([measured], []).position[-1, 0] < 5 * EXACT
    )  # a reading at an instant stands for an interval
    assert dut([dc.replace(measured, input="command")], []).position[-1, 0] > 20 * EXACT


def test_noise_of_the_start_attitude_is_smoothed_away(nominal):
    draw = np.random.default_rng(0)
    turn = np.concatenate(
        [np.ones((len(nominal), 1)), 0.005 * draw.normal(size=(len(nominal), 3))], axis=1
    )
    q = attitude.multiply(nominal.q, turn / np.linalg.norm(turn, axis=1, keepdims=True))
    noisy = dc.replace(nominal, q=q)
    assert position_error(noisy) < 0.5 * position_error(noisy, smooth=False)


def test_what_cannot_be_replayed_is_refused(nominal):
    with pytest.raises(ValueError, match="at least"):
        DrakeReplay(VEHICLE)([nominal.rows(0, 100)], [])
    with pytest.raises(ValueError, match="one flight"):
        DrakeReplay(VEHICLE)([], [])
    with pytest.raises(ValueError, match="positive"):
        DrakeReplay(VEHICLE, horizons=[0.0])


def test_a_replay_of_another_vehicle_has_the_same_starts_and_horizons(nominal):
    heavier, how = VEHICLE.with_mass(1.1 * VEHICLE.mass), {"starts": 2, "horizons": (0.1, 0.5)}
    dut = DrakeReplay(VEHICLE, **how).of_vehicle(heavier)([nominal], [])
    assert repr(dut) == repr(DrakeReplay(heavier, **how)([nominal], []))
    assert repr(dut) != repr(DrakeReplay(VEHICLE, **how)([nominal], []))
