"""Vehicle file of an identification: values, 95 % intervals and sources of its fields."""

import dataclasses as dc
from collections.abc import Sequence
from typing import Any

import numpy as np
import scipy

from np_drake.identification.identify import Identification
from np_drake.identification.quantities import SURE, Identified
from np_drake.vehicle import Vehicle
from np_drake.vehicle.vehicle import MOST_IDLE, Calibration, RateLoop, ThrottleMap

SHAPES = {
    "inertia": (3, 3),
    "calibration.center_of_mass": (3,),
    "calibration.rotor_gains": (4,),
    "calibration.imu_position": (3,),
    "calibration.imu_tilt": (3,),
}
DIGITS = 6
# largest uncertainty that a file states [1]; own choice: that of a coefficient of no flight
VAGUE = 0.4
SCALE_OF = {
    "rotor_speed": "thrust_coefficient",
    "throttle": "throttle.full_thrust",
    "collective": "throttle.full_thrust",
}  # thrust from what turns rotors
# least second moment of mass over the largest [1]; own choice: a sheet of 3 % of its length
FLATTEST = 1e-3


def identified_vehicle(identification: Identification, name: str) -> Vehicle:
    """Return the vehicle as flights tell it.
    Raises: ValueError: where only ratios to the mass are told, or the values are no vehicle's.
    """
    basis = identification.basis
    prior = identification.prior
    count = len(identification.models)
    if basis.ratios:
        raise ValueError(
            "identify: a vehicle file needs the mass, for flights tell thrust and inertia "
            "over it. Give --mass KG."
        )
    fields: dict[str, list[Identified]] = {}
    for quantity in identification.quantities:
        fields.setdefault(quantity.quantity.field, []).append(quantity)
    fields.pop("", None)
    named = f"identified from {count} flight{'s' if count > 1 else ''}"
    values: dict[str, Any] = {}
    intervals = dict[str, list[list[float]]]()
    sources = dict[str, str]()
    for field, quantities in fields.items():
        values[field], intervals[field] = _numbers(field, quantities, prior)
        sources[field] = _source(quantities, named)
    if basis.mass is not None:
        sources["mass"] = "given"
    sources |= dict.fromkeys(
        ("gravity", "rotor_positions", "rotor_directions", "rotor_radius"), f"given: {prior.name}"
    )
    if (body := _possible(np.array(values.get("inertia", prior.inertia)))) is not None:
        values["inertia"] = body.tolist()
        sources["inertia"] += "; zz lowered to the largest that a body can have"
    if "torque_coefficient" in values:  # told over thrust
        scale = values.get("thrust_coefficient", prior.thrust_coefficient)
        intervals["torque_coefficient"] = [
            [_rounded(scale * end) for end in intervals["torque_coefficient"][0]]
        ]
        values["torque_coefficient"] = _rounded(scale * values["torque_coefficient"])
    throttle = None
    full = values.get("throttle.full_thrust")
    if full is not None:
        power = float(np.clip(values.get("throttle.voltage_exponent", 0.0), 0.0, 4.0))
        linear = float(np.clip(values.get("throttle.linear", 0.0), -0.5, 1.5))
        idle = float(np.clip(values.get("throttle.idle", 0.0), 0.0, MOST_IDLE))
        throttle = ThrottleMap(full, linear, idle, basis.frame.volts or None, power)
        intervals["max_rotor_thrust"] = intervals["throttle.full_thrust"]
        sources["max_rotor_thrust"] = sources["throttle.full_thrust"]
    # Thrust is told over the mass: an error of a given mass is one of thrust by the same share, and
    # cancels in flight.
    for field, of in (("mass", "mass"), ("thrust", SCALE_OF.get(basis.drive))):
        if of in intervals:
            low, high = intervals[of][0]
            values[f"{field}_uncertainty"] = min(_rounded(np.log(high / low) / (2 * SURE)), VAGUE)
            sources[f"{field}_uncertainty"] = sources[of]
    own_fields = {f.partition(".")[2]: v for f, v in values.items() if f.startswith("calibration.")}
    if "rotor_gains" in own_fields:
        gains = own_fields["rotor_gains"]
        own_fields["rotor_gains"] = [_rounded(gain / float(np.mean(gains))) for gain in gains]
    if "command_delay" in own_fields:
        own_fields["command_delay"] = max(own_fields["command_delay"], 0.0)
    loop = None
    axes = identification.rate_loop
    if axes:
        lags, gains = ([_rounded(getattr(axis, of)) for axis in axes] for of in ("lag", "gain"))
        most = np.maximum([axis.max_rate for axis in axes], RateLoop().max_rate)
        loop = RateLoop(lags, gains, [_rounded(float(rate)) for rate in most])
        for of in ("lag", "gain"):
            within = (getattr(axis, f"{of}_interval") for axis in axes)
            intervals[f"rate_loop.{of}"] = [[_rounded(low), _rounded(high)] for low, high in within]
            sources[f"rate_loop.{of}"] = named
    return dc.replace(
        prior,
        name=name,
        mass=basis.mass_of(identification.estimate.layout.values(identification.estimate.z)),
        max_rotor_thrust=prior.max_rotor_thrust if full is None else full,
        throttle=throttle,
        calibration=Calibration(**own_fields),
        rate_loop=loop,
        sources=sources,
        intervals=intervals,
        **{f: v for f, v in values.items() if "." not in f and f != "mass"},
    ).check()


def _numbers(
    field: str, quantities: Sequence[Identified], prior: Vehicle
) -> tuple[Any, list[list[float]]]:
    """Return the value of a field as a vehicle file holds it, and the 95 % intervals of each of its
    numbers row by row; what flights do not tell of an array is the prior's.
    """
    if field not in SHAPES:
        return _rounded(quantities[0].value), [
            [_rounded(quantities[0].low), _rounded(quantities[0].high)]
        ]
    start = np.array(prior.inertia, float) if field == "inertia" else np.zeros(SHAPES[field])
    value = start.copy()
    low = start.copy()
    high = start.copy()
    for q in quantities:
        for out, number in ((value, q.value), (low, q.low), (high, q.high)):
            out[q.quantity.index] = out[q.quantity.index[::-1]] = _rounded(number)
    return value.tolist(), np.stack([low.ravel(), high.ravel()], axis=1).tolist()


def _source(quantities: Sequence[Identified], named: str) -> str:
    """Return what told a field, or why flights do not."""
    observable = [q for q in quantities if q.observable]
    unobservable = [q for q in quantities if not q.observable]
    if not unobservable:
        return named
    lacks = f"{unobservable[0].quantity.why}; {unobservable[0].quantity.manoeuvre} would tell"
    if not observable:
        return f"prior: {lacks}"
    return f"{named}: {', '.join(q.name for q in observable)}; prior: the rest, for {lacks}"


def _possible(J: np.ndarray) -> np.ndarray | None:
    """Return the inertia (3, 3) with zz, which flights tell least, lowered until it is one of a
    body; None where it is.

    Of a body, tr(J)/2 - J is the second moment of its mass, which no direction has below zero.
    """
    out = J.copy()

    def spare(zz: float) -> float:
        out[2, 2] = zz
        moments = np.linalg.eigvalsh(0.5 * np.trace(out) * np.eye(3) - out)
        return float(moments[0] - FLATTEST * moments[-1])

    low = float(max(J[0, 0], J[1, 1]))
    high = float(J[2, 2])
    if spare(high) >= 0.0 or spare(low) < 0.0:
        return None
    out[2, 2] = _rounded(scipy.optimize.brentq(spare, low, high))
    return out


def _rounded(value: float) -> float:
    return float(f"{value:.{DIGITS}g}")
