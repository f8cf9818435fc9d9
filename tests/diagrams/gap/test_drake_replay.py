"""Laws of the open-loop replay. The flights are made here, by hand, in Drake."""

import dataclasses as dc

import numpy as np
import pytest
from pydrake.systems.analysis import ApplySimulatorConfig, Simulator, SimulatorConfig

from diagrams.gap import drake_replay
from diagrams.gap.drake_replay import Commands, DrakeReplay, Rollout, Swing
from np_drake import attitude
from np_drake.effects import (
    ClockOffset,
    CommandDelay,
    Downwash,
    GyroBias,
    LinearDrag,
    MassError,
    MotorLag,
    SuspendedPayload,
    ThrustScale,
)
from np_drake.effects.calibration import effects_of
from np_drake.flight_log import FlightLog, Neighbour
from np_drake.vehicle import Vehicle
from np_drake.vehicle.vehicle import Calibration
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
        payload = payload or PayloadConfig(tether="none")
        self.diagram = make_tethered_quadrotor(VEHICLE, payload, **effects)
        self.simulator = Simulator(self.diagram)
        ApplySimulatorConfig(FINE, self.simulator)
        self.context = self.simulator.get_mutable_context()
        self.plant = self.diagram.GetSubsystemByName("plant")
        self.plant_context = self.plant.GetMyMutableContextFromRoot(self.context)
        set_hover(self.plant, self.plant_context, payload, [0.0, 0.0, 2.0])

    def fly(self, start, stop):
        """Rows [t, x, u, u that the rotors give] from start to stop [s]."""
        self.context.SetTime(start)
        self.simulator.Initialize()
        rows = []
        for k in range(round(start / STEP), round(stop / STEP)):
            x = self.diagram.GetOutputPort("x").Eval(self.context)
            u = self.command(k * STEP, x)
            self.diagram.GetInputPort("u").FixValue(self.context, u)
            thrust = self.diagram.GetOutputPort("rotor_thrust").Eval(self.context)
            rows.append(np.concatenate([[k * STEP], x, u, VEHICLE.mixer @ thrust]))
            self.simulator.AdvanceTo((k + 1) * STEP)
        return rows

    def command(self, t, x):
        wander = 0.9 * np.sin(np.array([5.0, 7.0, 3.0]) * t + [0.0, 1.0, 2.0])
        force = VEHICLE.mass * (wander - x[7:10] - (x[:3] - [0, 0, 2.0]) + [0.0, 0.0, 9.81])
        R = attitude.rotation_matrix(x[3:7])
        error = np.cross(R[:, 2], force / np.linalg.norm(force)) @ R
        torque = VEHICLE.J @ (80 * error - 15 * x[10:13])
        return VEHICLE.saturate(np.array([force @ R[:, 2], *torque]))


def log_of(rows):
    t, p, q, v, w, u, _ = np.split(np.array(rows), [1, 4, 8, 11, 14, 18], axis=1)
    return FlightLog(t=t[:, 0], p=p, q=q, v=v, w=w, u=u, name="a")


def position_error(log, *effects):
    """Median after 1 s [m]."""
    return DrakeReplay(VEHICLE, starts=6)([log], list(effects)).position[-1, 0]


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
    state = before.plant.GetPositionsAndVelocities(before.plant_context)
    after.plant.SetPositionsAndVelocities(after.plant_context, state)
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
    gains, late = [0.97, 1.01, 1.03, 0.99], {"clock_offset": 0.01, "command_delay": 0.01}
    known = Calibration([0.005, 0.0, 0.0], gains, **late).check()
    named = [(effect, {}) for effect in effects_of(known, VEHICLE)]
    for effects in ([], [(LinearDrag(0.1, 0.1, 0.1), {})]):
        dut = DrakeReplay(dc.replace(VEHICLE, calibration=known), starts=3)([nominal], effects)
        same = DrakeReplay(VEHICLE, starts=3)([nominal], [*named, *effects])
        np.testing.assert_allclose(dut.position, same.position)


def test_a_payload_swings_along_the_force_that_the_log_shows():
    payload = PayloadConfig(mass=0.3, length=0.6)
    log = log_of(Flyer(payload).fly(0.0, 4.0))
    nominal = position_error(log)
    seen = position_error(log, (SuspendedPayload(0.3, 0.6, *payload.hook), {"a": None}))
    assert seen < 0.2 * nominal
    assert nominal > 50 * EXACT


def test_a_payload_takes_the_place_of_the_one_before():
    config = PayloadConfig(mass=0.3, length=0.6)
    hung, free = Flyer(config), Flyer()
    rows = hung.fly(0.0, 2.0)
    state, n = hung.plant.GetPositionsAndVelocities(hung.plant_context), hung.plant.num_positions()
    free.plant.SetPositionsAndVelocities(free.plant_context, np.r_[state[:7], state[n : n + 6]])
    log = log_of(rows + free.fly(2.0, 4.0))
    payload = SuspendedPayload(0.3, 0.6, *config.hook)
    dropped = dc.replace(payload, mass=0.0), {"a": 2.0}
    seen = position_error(log, (payload, {"a": None}), dropped)
    assert seen < 0.5 * position_error(log, (payload, {"a": None}))


def test_measured_rotor_speed_has_lagged_already():
    lagging = dc.replace(VEHICLE, rotor_time_constant=0.05)
    rows = Flyer(actuator_effects=[MotorLag(0.05)]).fly(0.0, 4.0)
    dut, log = DrakeReplay(lagging, starts=4), log_of(rows)
    measured = dc.replace(log, u=np.array(rows)[:, 18:], input="rotor_speed")
    assert dut([log], []).position[-1, 0] < 2 * EXACT
    # A reading at an instant stands for an interval.
    assert dut([measured], []).position[-1, 0] < 5 * EXACT
    assert dut([dc.replace(measured, input="command")], []).position[-1, 0] > 20 * EXACT


def test_what_cannot_be_replayed_is_refused(nominal):
    with pytest.raises(ValueError, match="at least"):
        DrakeReplay(VEHICLE)([nominal.rows(0, 100)], [])
    with pytest.raises(ValueError, match="one flight"):
        DrakeReplay(VEHICLE)([], [])


@pytest.mark.parametrize("mass", [0.01, 0.1])
def test_the_softer_cable_of_a_light_payload_is_not_seen(mass, monkeypatch):
    def flown(payload):
        """Of a vehicle that is pushed hard from hover, its payload aslant."""
        t, x = 0.01 * np.arange(101), np.zeros(13)
        u = np.zeros((len(t), 4))
        u[:, 0] = VEHICLE.mass * VEHICLE.gravity * (1.1 + 0.3 * np.sin(9 * t))
        x[2], x[3] = 2.0, 1.0
        swing = Swing(payload.length * np.array([0.6, 0.0, -0.8]), np.zeros(3), np.zeros(3))
        times = np.array([0.0, 0.25, 0.5, 1.0])
        return Rollout(VEHICLE, [payload]).fly(x, Commands(t, u), times, swing)[:, :13]

    payload = SuspendedPayload(mass=mass, length=0.3)
    soft, bare = flown(payload), flown(SuspendedPayload(mass=1e-4, length=0.3))
    monkeypatch.setattr(drake_replay, "as_light", lambda config: config)
    stiff = flown(payload)
    assert np.all(np.isfinite(soft))
    assert np.abs(soft - stiff).max() < 0.01 * np.abs(stiff - bare).max()
