import dataclasses as dc

import numpy as np
import pytest
from pydrake.systems.analysis import ApplySimulatorConfig, Simulator, SimulatorConfig

from np_drake import attitude
from np_drake.effects.suspended_payload import SuspendedPayload
from np_drake.vehicle import Vehicle
from systems.payload_config import PayloadConfig, payload_config
from systems.plant import set_hover
from systems.tethered_quadrotor import make_tethered_quadrotor

VEHICLE, STEP = Vehicle(), 0.004


def test_the_effect_becomes_a_body_with_its_figures():
    found = payload_config(SuspendedPayload(0.3, 1.1, 0.01, 0.02, -0.03, 0.2))
    same = {"mass": 0.3, "length": 1.1, "hook": [0.01, 0.02, -0.03], "air_damping": 0.2}
    assert found == PayloadConfig(tether="cable", **same)
    assert (
        payload_config(None).tether == payload_config(SuspendedPayload(mass=0.0)).tether == "none"
    )


@pytest.mark.parametrize("damping", [0.0, 0.8])
def test_a_log_of_the_hook_brings_back_the_wrench_of_drakes_cable(damping, apply_impulse):
    effect = SuspendedPayload(0.3, 0.7, 0.02, -0.01, -0.04, damping)
    payload = payload_config(effect)
    dut = make_tethered_quadrotor(VEHICLE, payload)
    simulator = Simulator(dut)
    scheme = SimulatorConfig(
        integration_scheme="runge_kutta3", max_step_size=1e-3, use_error_control=False
    )
    ApplySimulatorConfig(scheme, simulator)
    context = simulator.get_mutable_context()
    plant = dut.GetSubsystemByName("plant")
    plant_context = plant.GetMyMutableContextFromRoot(context)
    set_hover(plant, plant_context, payload, [0, 0, 3.0])
    apply_impulse(plant, plant_context, [0.3, 0.2, 0.0])
    dut.GetInputPort("u").FixValue(context, [2.3 * VEHICLE.gravity, 0.004, -0.003, 0.001])
    s = dut.GetOutputPort("plant_state").Eval(context)
    hook = attitude.rotate(s[0:4], np.array(payload.hook))
    r, r_rate = s[11:14] - s[4:7] - hook, s[23:26] - s[17:20] - np.cross(s[14:17], hook)
    x, acceleration, wrench = [], [], []
    for k in range(250):
        # the middle of the steps: held motion to second order
        simulator.AdvanceTo(STEP * (k + 0.5))
        x.append(dut.GetOutputPort("x").Eval(context))
        acceleration.append(dut.GetOutputPort("acceleration").Eval(context))
        wrench.append(dut.GetOutputPort("tether_wrench").Eval(context))
    a, al = np.split(np.array(acceleration), 2, axis=1)
    found = effect.wrench_along(VEHICLE, x=np.array(x), a=a, al=al, step=STEP, r=r, r_rate=r_rate)
    # The cable's own vibration at 45 Hz and its stretch are not in the model.
    np.testing.assert_allclose(found[25:, :3], np.array(wrench)[25:, :3], atol=0.03)  # [N]
    np.testing.assert_allclose(found[25:, 3:], np.array(wrench)[25:, 3:], atol=2e-3)  # [N·m]
    assert np.linalg.norm(x[-1][7:9]) > 0.1  # [m/s]: the hook moves through the air
    if damping:
        vacuum = dc.replace(effect, damping=0.0)
        other = vacuum.wrench_along(
            VEHICLE, x=np.array(x), a=a, al=al, step=STEP, r=r, r_rate=r_rate
        )
        assert np.abs(other[25:, :2] - found[25:, :2]).max() > 0.15  # [N]
