"""Scenarios for any vehicle: the sizes, times and forces of one for the paper's vehicle, scaled to
another.
"""

import copy
import dataclasses as dc
from collections.abc import Iterable
from typing import Any

from np_drake.command_delay import LONGEST_DELAY
from np_drake.vehicle.scaling import Scales, payload_ratio, ratios, times

# Powers of length, mass and time in the unit of each field. Angles, shares, seeds, names and the
# noise of sensors have none: a sensor does not shrink with the vehicle that carries it.
FLIGHT = {"duration": (0, 0, 1)}
REALITY = {
    "rotor_drag": (0, 1, -1),
    **dict.fromkeys(("motor_lag", "command_delay"), (0, 0, 1)),
    "thrust_loss": (0, 0, -1),
    **dict.fromkeys(("wind", "gust"), (1, 0, -1)),
}
REFERENCE = {
    **dict.fromkeys(("radius", "length", "width", "rise", "height", "within"), (1, 0, 0)),
    **dict.fromkeys(("amplitude", "dither"), (1, 0, 0)),
    "speed": (1, 0, -1),
    **dict.fromkeys(("ramp", "rest"), (0, 0, 1)),
    **dict.fromkeys(("band", "dither_frequencies"), (0, 0, -1)),
}
# The mass here is the payload's own (`payload_ratio`), so that the cable stretches by the same
# share of its length under the payload's weight, and its axial oscillation takes the same share of
# the unit of time.
PAYLOAD = {
    **dict.fromkeys(("length", "hook", "radius"), (1, 0, 0)),
    "mass": (0, 1, 0),
    "stiffness": (0, 1, -2),
    "damping": (0, 1, -1),
    "air_damping": (0, 0, -1),
}
EVENT = {"time": (0, 0, 1), "mass": (0, 1, 0), "impulse": (1, 1, -1)}  # of the payload, as above
MPC = {  # a cost has no unit: a weight is the inverse square of what it weighs
    "weight_position": (-2, 0, 0),
    "weight_velocity": (-2, 0, 2),
    "weight_rate": (0, 0, 2),
    "weight_rates": (0, 0, 2),
    "weight_swing": (-2, -2, 4),
    "max_speed": (1, 0, -1),
    "terminal_radius": (1, 0, 0),
    "slack_weight": (-1, 0, 0),  # the unit of the ellipsoid, of the three sets
}
FIRMWARE = {"bandwidth": (0, 0, -1)}
CLOCK = {
    "period": 1,
    "hold_bandwidth": -1,
}  # powers of the sampling period in the controller's fields
LABEL = {"force_bandwidth": -1, "torque_bandwidth": -1}


def scaled(config: Any) -> Any:
    """Return the scenario `config`, which stands in SI for the paper's vehicle, for its own
    vehicle.

    Every field is multiplied by the ratio of the two vehicles' units, which is exactly 1 for the
    paper's.
    Raises: ValueError: on the track of a file, which stands in SI.
    """
    if config.reference.is_file:
        raise ValueError(
            "FlightConfig: scaled must be false for the track of a CSV file, which stands "
            "in SI; got true. "
            "Leave it out."
        )
    unit = ratios(config.vehicle)
    carried = Scales(
        unit.length, payload_ratio(config.vehicle, type(config.reality.payload)().mass), unit.time
    )
    controller, mpc = config.controller, _times(config.controller.mpc, MPC, unit)
    thrust, *torques = mpc.weight_input
    weights = [thrust / unit.force**2, *(t / unit.torque**2 for t in torques)]
    # Of the vehicle's calibration the controller knows the delay of commands.
    known = min(
        config.vehicle.calibration.command_delay, LONGEST_DELAY * controller.period * unit.clock
    )
    simulator = copy.copy(config.simulator)
    simulator.max_step_size *= unit.time
    return dc.replace(
        _times(config, FLIGHT, unit),
        reality=dc.replace(
            _times(config.reality, REALITY, unit),
            payload=_times(config.reality.payload, PAYLOAD, carried),
        ),
        reference=_times(config.reference, REFERENCE, unit),
        controller=dc.replace(
            _paced(controller, CLOCK, unit),
            extra_mass=controller.extra_mass * carried.mass,
            command_delay=controller.command_delay * unit.time or known,
            mpc=dc.replace(mpc, weight_input=weights, step=mpc.step * unit.clock),
            label=_paced(controller.label, LABEL, unit),
        ),
        autopilot=dc.replace(
            config.autopilot, betaflight=_times(config.autopilot.betaflight, FIRMWARE, unit)
        ),
        events=[_times(event, EVENT, carried) for event in config.events],
        simulator=simulator,
        scaled=False,
    )


def _times(part: Any, powers: dict[str, tuple[int, int, int]], unit: Scales) -> Any:
    """Return a copy of a dataclass, each field of `powers` multiplied by these powers of the
    units.
    """
    return _replaced(
        part,
        (
            (name, unit.length**a * unit.mass**b * unit.time**c)
            for name, (a, b, c) in powers.items()
        ),
    )


def _paced(part: Any, powers: dict[str, int], unit: Scales) -> Any:
    """Return a copy of a dataclass, each field of `powers` multiplied by this power of the sampling
    period.
    """
    return _replaced(part, ((name, unit.clock**power) for name, power in powers.items()))


def _replaced(part: Any, factors: Iterable[tuple[str, float]]) -> Any:
    return dc.replace(
        part, **{name: times(getattr(part, name), factor) for name, factor in factors}
    )
