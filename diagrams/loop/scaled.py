"""Scenarios for any vehicle: the sizes, times and forces of one for the paper's vehicle, scaled to
another.
"""

import copy
import dataclasses as dc
import math
from typing import Any

from np_drake.command_delay import LONGEST_DELAY
from np_drake.vehicle.scaling import Scales, payload_ratio, ratios

# Powers of length, mass, time and sampling period in the unit of each field. Angles, shares, seeds,
# names and the noise of sensors have none: a sensor does not shrink with the vehicle that carries
# it.
LENGTH = (1, 0, 0, 0)
MASS = (0, 1, 0, 0)
TIME = (0, 0, 1, 0)
RATE = (0, 0, -1, 0)
SPEED = (1, 0, -1, 0)
CLOCK = (0, 0, 0, 1)
PER_CLOCK = (0, 0, 0, -1)
FLIGHT: dict[str, Any] = {
    "duration": TIME,
    "reality": {
        "rotor_drag": (0, 1, -1, 0),
        "motor_lag": TIME,
        "command_delay": TIME,
        "thrust_loss": RATE,
        "wind": SPEED,
        "gust": SPEED,
    },
    "reference": {
        **dict.fromkeys(("radius", "length", "width", "rise", "height", "within"), LENGTH),
        "amplitude": LENGTH,
        "dither": LENGTH,
        "speed": SPEED,
        "ramp": TIME,
        "rest": TIME,
        "band": RATE,
        "dither_frequencies": RATE,
    },
    "controller": {
        "period": CLOCK,
        "command_delay": TIME,
        "label": {"force_bandwidth": PER_CLOCK, "torque_bandwidth": PER_CLOCK},
        "mpc": {  # a cost has no unit: a weight is the inverse square of what it weighs
            "weight_position": (-2, 0, 0, 0),
            "weight_velocity": (-2, 0, 2, 0),
            "weight_rate": (0, 0, 2, 0),
            "weight_rates": (0, 0, 2, 0),
            "weight_swing": (-2, -2, 4, 0),
            "max_speed": SPEED,
            "step": CLOCK,
            "terminal_radius": LENGTH,
            "slack_weight": (-1, 0, 0, 0),  # the unit of the ellipsoid, of the three sets
        },
    },
    "autopilot": {"betaflight": {"bandwidth": RATE}},
}
# The mass here is the payload's own (`payload_ratio`), so that the cable stretches by the same
# share of its length under the payload's weight, and its axial oscillation takes the same share of
# the unit of time.
PAYLOAD = {
    "length": LENGTH,
    "hook": LENGTH,
    "radius": LENGTH,
    "mass": MASS,
    "rope_mass": MASS,
    "stiffness": (0, 1, -2, 0),
    "damping": (0, 1, -1, 0),
    "air_damping": RATE,
    "rope_air_damping": RATE,
}
EVENT = {"time": TIME, "mass": MASS, "impulse": (1, 1, -1, 0)}  # of the payload, as above


def scaled(config: Any) -> Any:
    """Return the scenario `config`, which stands in SI for the paper's vehicle, for its own
    vehicle.

    Every field is multiplied by the ratio of the two vehicles' units, which is exactly 1 for the
    paper's.
    Raises: ValueError: on the track of a file, which stands in SI.
    """
    if config.reference.is_file:
        raise ValueError(
            "FlightConfig: scaled must be false for the track of a CSV file, which stands in SI; "
            "got true. Leave it out."
        )
    unit = ratios(config.vehicle)
    lighter = payload_ratio(config.vehicle, type(config.reality.payload)().mass)
    carried = Scales(unit.length, lighter, unit.time)
    flight = _times(config, FLIGHT, unit)
    flight.scaled = False
    flight.reality.payload = _times(config.reality.payload, PAYLOAD, carried)
    flight.events = [_times(event, EVENT, carried) for event in config.events]
    flight.simulator = copy.copy(config.simulator)
    flight.simulator.max_step_size *= unit.time
    controller = flight.controller
    controller.extra_mass *= carried.mass
    if not controller.command_delay:  # of the vehicle's calibration the controller knows it
        longest = LONGEST_DELAY * config.controller.period * unit.clock
        controller.command_delay = min(config.vehicle.calibration.command_delay, longest)
    thrust, *torques = controller.mpc.weight_input
    controller.mpc.weight_input = [
        thrust / unit.force**2,
        *(torque / unit.torque**2 for torque in torques),
    ]
    return flight


def _times(part: Any, powers: dict[str, Any], unit: Scales) -> Any:
    """Return a copy of a dataclass, each field of `powers` multiplied by these powers of the units,
    and the fields of the dataclasses in it likewise.
    """
    units = (unit.length, unit.mass, unit.time, unit.clock)
    changed = {}
    for name, power in powers.items():
        value = getattr(part, name)
        if isinstance(power, dict):
            changed[name] = _times(value, power, unit)
        else:
            factor = math.prod(u**n for u, n in zip(units, power, strict=True))
            several = isinstance(value, list | tuple)
            changed[name] = [v * factor for v in value] if several else value * factor
    return dc.replace(part, **changed)
