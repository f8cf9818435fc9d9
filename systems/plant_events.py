"""Events of a plant at given times, declared on the plant itself: an impulse on its payload, a
payload that is hung on.

A plain `Simulator` triggers them, each before the discrete updates of its instant, such as the
controller's.
"""

from collections.abc import Callable

import numpy as np
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.framework import Context, LeafSystem, State

from systems.payload_config import PayloadConfig

Update = Callable[[Context, State], None]
_ONCE = 1e9  # period of an event that is to happen once: Drake's scheduled events are periodic [s]


def declare_event_at(system: LeafSystem, time: float, update: Update) -> None:
    """Declare an unrestricted update of `system` at one time; nothing where it is infinite or not
    after the start.

    Args:
        system: whose state is updated.
        time: of the event, at which a step of the integrator ends [s].
        update: of the state.
    """
    if 0.0 < time < np.inf:
        system.DeclarePeriodicUnrestrictedUpdateEvent(
            period_sec=_ONCE, offset_sec=time, update=update
        )


def setting(value: float) -> Update:
    """Return the update that sets the first discrete state of a system to a value."""

    def update(context: Context, state: State) -> None:
        state.get_mutable_discrete_state(0).SetAtIndex(0, value)

    return update


def declare_step_end(system: LeafSystem, time: float) -> None:
    """Let a step of the integrator end at a time, where a force begins that knows the time itself.

    Args:
        system: on which the event is declared.
        time: [s].
    """
    declare_event_at(system, time, lambda context, state: None)


def declare_impulse(plant: MultibodyPlant, time: float, impulse, mass: float) -> None:
    """Declare that the payload's velocity jumps by impulse over mass.

    Args:
        plant: with a free body `payload`.
        time: of the event [s].
        impulse: (3,) in W [N·s].
        mass: of the payload at that time [kg].
    """
    start = plant.num_positions() + plant.GetJointByName("payload").velocity_start() + 3
    jump = np.asarray(impulse, float) / mass

    def update(context: Context, state: State) -> None:
        vector = state.get_mutable_continuous_state().get_mutable_vector()
        for axis in range(3):
            vector.SetAtIndex(start + axis, vector.GetAtIndex(start + axis) + jump[axis])

    declare_event_at(plant, time, update)


def declare_hanging(plant: MultibodyPlant, time: float, payload: PayloadConfig) -> None:
    """Declare that the payload is put vertically under the hook, at the tether's length, moving
    with the hook.

    Args:
        plant: with the free bodies `quadrotor` and `payload`.
        time: of the event; until then the payload falls freely [s].
        payload: its tether.
    """
    B, joint = plant.GetBodyByName("quadrotor"), plant.GetJointByName("payload")
    q_start, v_start = joint.position_start(), plant.num_positions() + joint.velocity_start()

    def update(context: Context, state: State) -> None:
        X, V = (
            plant.EvalBodyPoseInWorld(context, B),
            plant.EvalBodySpatialVelocityInWorld(context, B),
        )
        hook = X.rotation() @ np.asarray(payload.hook, float)
        p_WP = X.translation() + hook - [0.0, 0.0, payload.length]
        v_WP = V.translational() + np.cross(V.rotational(), hook)
        vector = state.get_mutable_continuous_state().get_mutable_vector()
        for start, values in (
            (q_start, [1.0, 0.0, 0.0, 0.0, *p_WP]),
            (v_start, [0.0, 0.0, 0.0, *v_WP]),
        ):
            for k, value in enumerate(values):
                vector.SetAtIndex(start + k, value)

    declare_event_at(plant, time, update)
