"""Vehicle file of an identification: values, 95 % intervals and sources of its fields."""

import dataclasses as dc
from collections.abc import Sequence

import numpy as np

from np_drake.identification.identify import Identification
from np_drake.identification.quantities import SURE, Identified
from np_drake.vehicle import Vehicle
from np_drake.vehicle.vehicle import Calibration, RateLoop, ThrottleMap

SHAPES = {
    "inertia": (3, 3),
    "calibration.center_of_mass": (3,),
    "calibration.rotor_gains": (4,),
    "calibration.imu_position": (3,),
    "calibration.imu_tilt": (3,),
}
# 95 % of the height of a centre of mass, in arms [1]; own choice: that of a battery above or below
HEIGHT = 0.1
DIGITS = 6
# largest uncertainty that a file states [1]; own choice: that of a coefficient of no flight
VAGUE = 0.4
SCALE_OF = {
    "rotor_speed": "thrust_coefficient",
    "throttle": "throttle.full_thrust",
}  # thrust from what turns rotors
# least second moment of mass over the largest [1]; own choice: a sheet of 3 % of its length
FLATTEST = 1e-3


def identified_vehicle(found: Identification, name: str) -> Vehicle:
    """Return the vehicle as flights tell it.
    Raises: ValueError: where only ratios to the mass are told, or the values are no vehicle's.
    """
    if found.basis.ratios:
        raise ValueError(
            "identify: a vehicle file needs the mass, for flights tell thrust and inertia "
            "over it. Give --mass KG."
        )
    prior = found.prior
    fields: dict[str, list[Identified]] = {}
    for quantity in found.quantities:
        if quantity.quantity.field:
            fields.setdefault(quantity.quantity.field, []).append(quantity)
    values = {field: _value(field, own, prior) for field, own in fields.items()}
    intervals = {field: _intervals(field, own, prior) for field, own in fields.items()}
    sources = {field: _source(own, len(found.models)) for field, own in fields.items()}
    mass = found.basis.mass_of(found.estimate.layout.values(found.estimate.z))
    if found.basis.mass is not None:
        sources["mass"] = "given"
    for field in ("gravity", "rotor_positions", "rotor_directions", "rotor_radius"):
        sources[field] = f"given: {prior.name}"
    if (body := _possible(np.array(values["inertia"]))) is not None:
        values["inertia"] = body.tolist()
        sources["inertia"] += "; zz lowered to the largest that a body can have"
    coefficient = values.get("thrust_coefficient", prior.thrust_coefficient)
    if "torque_coefficient" in values:
        intervals["torque_coefficient"] = [
            [_rounded(coefficient * end) for end in intervals["torque_coefficient"][0]]
        ]
        values["torque_coefficient"] = _rounded(coefficient * values["torque_coefficient"])
    throttle = None
    if "throttle.full_thrust" in values:
        volts = found.basis.frame.volts or None
        throttle = ThrottleMap(
            values["throttle.full_thrust"],
            float(np.clip(values.get("throttle.linear", 0.0), -0.5, 1.5)),
            0.0,
            volts,
            float(np.clip(values.get("throttle.voltage_exponent", 0.0), 0.0, 4.0))
            if volts
            else 0.0,
        )
        if volts is None:
            intervals.pop("throttle.voltage_exponent", None)
            sources.pop("throttle.voltage_exponent", None)
        intervals["max_rotor_thrust"] = intervals["throttle.full_thrust"]
        sources["max_rotor_thrust"] = sources["throttle.full_thrust"]
    # Thrust is told over the mass: an error of a given mass is one of thrust by the same share, and
    # cancels in flight.
    for field, of in (
        ("mass_uncertainty", "mass"),
        ("thrust_uncertainty", SCALE_OF.get(found.basis.drive)),
    ):
        if of in intervals:
            low, high = intervals[of][0]
            values[field], sources[field] = (
                min(_rounded(np.log(high / low) / (2 * SURE)), VAGUE),
                sources[of],
            )
    own = {
        field.partition(".")[2]: value
        for field, value in values.items()
        if field.startswith("calibration.")
    }
    if "rotor_gains" in own:
        own["rotor_gains"] = [
            _rounded(gain / float(np.mean(own["rotor_gains"]))) for gain in own["rotor_gains"]
        ]
    if "command_delay" in own:
        own["command_delay"] = max(own["command_delay"], 0.0)
    calibration = Calibration(**own)
    loop = None
    if found.rate_loop:
        lags, gains = (
            [_rounded(getattr(axis, of)) for axis in found.rate_loop] for of in ("lag", "gain")
        )
        most = np.maximum([axis.max_rate for axis in found.rate_loop], RateLoop().max_rate)
        loop = RateLoop(lags, gains, [_rounded(float(rate)) for rate in most])
        for of in ("lag", "gain"):
            ends = (getattr(axis, f"{of}_interval") for axis in found.rate_loop)
            intervals[f"rate_loop.{of}"] = [[_rounded(low), _rounded(high)] for low, high in ends]
            sources[f"rate_loop.{of}"] = (
                f"identified from {len(found.models)} flight{'s' * (len(found.models) > 1)}"
            )
    plain = {f: v for f, v in values.items() if "." not in f and f != "mass"}
    return dc.replace(
        prior,
        name=name,
        mass=mass,
        max_rotor_thrust=values.get("throttle.full_thrust", prior.max_rotor_thrust),
        throttle=throttle,
        calibration=calibration,
        rate_loop=loop,
        sources=sources,
        intervals=intervals,
        **plain,
    ).check()


def _possible(J: np.ndarray) -> np.ndarray | None:
    """Return the inertia (3, 3) with zz, which flights tell least, lowered until it is one of a
    body; None where it is.

    Of a body, tr(J)/2 - J is the second moment of its mass, which no direction has below zero.
    """

    def flat(zz: float) -> bool:
        moments = np.linalg.eigvalsh(0.5 * (np.trace(J) - J[2, 2] + zz) * np.eye(3) - _with(J, zz))
        return bool(moments[0] < FLATTEST * moments[-1])

    low, high = float(max(J[0, 0], J[1, 1])), float(J[2, 2])
    if not flat(high) or flat(low):
        return None
    while high - low > 10.0**-DIGITS * high:
        middle = 0.5 * (low + high)
        low, high = (low, middle) if flat(middle) else (middle, high)
    return _with(J, _rounded(low))


def _with(J: np.ndarray, zz: float) -> np.ndarray:
    """Return the inertia (3, 3) with another moment about z.

    Args:
        J: inertia [kg·m²].
        zz: moment about z [kg·m²].
    """
    out = J.copy()
    out[2, 2] = zz
    return out


def _rounded(value: float) -> float:
    return float(f"{value:.{DIGITS}g}")


def _array(field: str, own: Sequence[Identified], prior: Vehicle, of) -> np.ndarray:
    """Return an array of the field's shape with `of` of each quantity; what flights do not tell is
    the prior's.
    """
    out = np.array(prior.inertia, float) if field == "inertia" else np.zeros(SHAPES[field])
    for quantity in own:
        out[quantity.quantity.index] = out[quantity.quantity.index[::-1]] = _rounded(of(quantity))
    return out


def _value(field: str, own: Sequence[Identified], prior: Vehicle):
    """Return the value of a field as a vehicle file holds it."""
    if field in SHAPES:
        return _array(field, own, prior, lambda q: q.value).tolist()
    return _rounded(own[0].value)


def _intervals(field: str, own: Sequence[Identified], prior: Vehicle) -> list[list[float]]:
    """Return the 95 % intervals of a field, of each number row by row."""
    if field not in SHAPES:
        return [[_rounded(own[0].low), _rounded(own[0].high)]]
    low, high = (_array(field, own, prior, of) for of in (lambda q: q.low, lambda q: q.high))
    if field == "calibration.center_of_mass":
        arm = float(np.linalg.norm(prior.rotor_positions, axis=1).mean())
        low[2], high[2] = _rounded(-HEIGHT * arm), _rounded(HEIGHT * arm)
    return [[float(a), float(b)] for a, b in zip(low.ravel(), high.ravel(), strict=True)]


def _source(own: Sequence[Identified], flights: int) -> str:
    """Return what told a field, or why flights do not."""
    named = f"identified from {flights} flight{'s' * (flights > 1)}"
    told, other = [q for q in own if q.told], [q for q in own if not q.told]
    if not other:
        return named
    lacks = f"{other[0].quantity.why}; {other[0].quantity.manoeuvre} would tell"
    if not told:
        return f"prior: {lacks}"
    return f"{named}: {', '.join(q.name for q in told)}; prior: the rest, for {lacks}"
