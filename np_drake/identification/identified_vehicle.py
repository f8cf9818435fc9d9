"""Vehicle file of an identification: values, 95 % intervals and sources of its fields."""

import dataclasses as dc
from collections.abc import Sequence
from typing import Any

import numpy as np
import scipy

from np_drake.identification.identify import Identification
from np_drake.identification.quantities import Z_975, Identified
from np_drake.identification.rate_loop import AxisLoop
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
FLATTEST_BODY = 1e-3


def identified_vehicle(identification: Identification, name: str) -> Vehicle:
    """Return the vehicle as flights tell it.
    Raises: ValueError: where only ratios to the mass are told, or the values are no vehicle's.
    """
    basis = identification.basis
    prior = identification.prior
    if basis.ratios:
        raise ValueError(
            "identify: a vehicle file needs the mass, for flights tell thrust and inertia "
            "over it. Give --mass KG."
        )
    fields = _Fields.of(identification)
    fields.make_inertia_possible()
    fields.scale_torque()
    throttle = fields.throttle(basis.frame.volts)
    fields.add_uncertainties(basis.drive)
    loop = fields.rate_loop(identification.rate_loop)
    plain = {f: v for f, v in fields.values.items() if "." not in f and f != "mass"}
    return dc.replace(
        prior,
        name=name,
        mass=basis.mass_of(identification.estimate.layout.values(identification.estimate.z)),
        max_rotor_thrust=throttle.full_thrust if throttle else prior.max_rotor_thrust,
        throttle=throttle,
        calibration=fields.calibration(),
        rate_loop=loop,
        sources=fields.sources,
        intervals=fields.intervals,
        **plain,
    ).check()


@dc.dataclass(frozen=True)
class _Fields:
    """Fields of a vehicle file by name: values, 95 % intervals and sources.

    prior: vehicle whose geometry was given.
    flights: source of what flights tell.
    """

    prior: Vehicle
    flights: str
    values: dict[str, Any] = dc.field(default_factory=dict)
    intervals: dict[str, list[list[float]]] = dc.field(default_factory=dict)
    sources: dict[str, str] = dc.field(default_factory=dict)

    @classmethod
    def of(cls, identification: Identification) -> "_Fields":
        """Return the fields that the quantities of an identification have."""
        prior = identification.prior
        count = len(identification.models)
        fields = cls(prior, f"identified from {count} flight{'s' if count > 1 else ''}")
        by_field: dict[str, list[Identified]] = {}
        for q in identification.quantities:
            by_field.setdefault(q.quantity.field, []).append(q)
        by_field.pop("", None)
        for field, quantities in by_field.items():
            fields.values[field], fields.intervals[field] = _numbers(field, quantities, prior)
            fields.sources[field] = _source(quantities, fields.flights)
        if identification.basis.mass is not None:
            fields.sources["mass"] = "given"
        given = ("gravity", "rotor_positions", "rotor_directions", "rotor_radius")
        fields.sources.update(dict.fromkeys(given, f"given: {prior.name}"))
        return fields

    def make_inertia_possible(self) -> None:
        """Lower zz of the inertia to that of a body."""
        body = _possible(np.array(self.values.get("inertia", self.prior.inertia)))
        if body is not None:
            self.values["inertia"] = body.tolist()
            self.sources["inertia"] += "; zz lowered to the largest that a body can have"

    def scale_torque(self) -> None:
        """Turn the torque, which flights tell over thrust, into its coefficient."""
        field = "torque_coefficient"
        if field in self.values:
            scale = self.values.get("thrust_coefficient", self.prior.thrust_coefficient)
            self.intervals[field] = [[_rounded(scale * end) for end in self.intervals[field][0]]]
            self.values[field] = _rounded(scale * self.values[field])

    def add_uncertainties(self, drive: str) -> None:
        """State the uncertainty of mass and thrust [1].

        Thrust is told over the mass: an error of a given mass is one of thrust by the same share,
        and cancels in flight.
        """
        for name, field in (("mass", "mass"), ("thrust", SCALE_OF.get(drive, ""))):
            if field in self.intervals:
                low, high = self.intervals[field][0]
                sigma = _rounded(np.log(high / low) / (2 * Z_975))
                self.values[f"{name}_uncertainty"] = min(sigma, VAGUE)
                self.sources[f"{name}_uncertainty"] = self.sources[field]

    def throttle(self, volts: float | None) -> ThrottleMap | None:
        """Return the map of the throttle at a reference voltage [V]; None where none is told."""
        full = self.values.get("throttle.full_thrust")
        if full is None:
            return None
        power = float(np.clip(self.values.get("throttle.voltage_exponent", 0.0), 0.0, 4.0))
        linear = float(np.clip(self.values.get("throttle.linear", 0.0), -0.5, 1.5))
        idle = float(np.clip(self.values.get("throttle.idle", 0.0), 0.0, MOST_IDLE))
        self.intervals["max_rotor_thrust"] = self.intervals["throttle.full_thrust"]
        self.sources["max_rotor_thrust"] = self.sources["throttle.full_thrust"]
        return ThrottleMap(full, linear, idle, volts, power)

    def calibration(self) -> Calibration:
        """Return the calibration: rotor gains about a mean of 1, and no negative delay."""
        prefix = "calibration."
        fields = {f.removeprefix(prefix): v for f, v in self.values.items() if f.startswith(prefix)}
        if gains := fields.get("rotor_gains"):
            fields["rotor_gains"] = [_rounded(gain / float(np.mean(gains))) for gain in gains]
        if "command_delay" in fields:
            fields["command_delay"] = max(fields["command_delay"], 0.0)
        return Calibration(**fields)

    def rate_loop(self, axes: Sequence[AxisLoop]) -> RateLoop | None:
        """Return the rate loop of an autopilot; None where flights show none."""
        if not axes:
            return None
        lags, gains = ([_rounded(getattr(axis, of)) for axis in axes] for of in ("lag", "gain"))
        most = np.maximum([axis.max_rate for axis in axes], RateLoop().max_rate)
        for of in ("lag", "gain"):
            ends = (getattr(axis, f"{of}_interval") for axis in axes)
            self.intervals[f"rate_loop.{of}"] = [[_rounded(a), _rounded(b)] for a, b in ends]
            self.sources[f"rate_loop.{of}"] = self.flights
        return RateLoop(lags, gains, [_rounded(float(rate)) for rate in most])


def _numbers(
    field: str, quantities: Sequence[Identified], prior: Vehicle
) -> tuple[Any, list[list[float]]]:
    """Return the value of a field as a vehicle file holds it, and the 95 % intervals of each of its
    numbers row by row; what flights do not tell of an array is the prior's.
    """
    start = prior.inertia if field == "inertia" else np.zeros(SHAPES.get(field, ()))
    table = np.stack([start] * 3, axis=-1, dtype=float)  # value, low, high
    for q in quantities:
        numbers = [_rounded(number) for number in (q.value, q.low, q.high)]
        table[q.quantity.index] = table[q.quantity.index[::-1]] = numbers
    return table[..., 0].tolist(), table[..., 1:].reshape(-1, 2).tolist()


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
        return float(moments[0] - FLATTEST_BODY * moments[-1])

    low = float(max(J[0, 0], J[1, 1]))
    high = float(J[2, 2])
    if spare(high) >= 0.0 or spare(low) < 0.0:
        return None
    out[2, 2] = _rounded(scipy.optimize.brentq(spare, low, high))
    return out


def _rounded(value: float) -> float:
    return float(f"{value:.{DIGITS}g}")
