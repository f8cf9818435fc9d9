"""What is known about the real flights, with its source: causes that are there, may be there, or
are not.
"""

import dataclasses as dc
import math
from collections.abc import Collection, Mapping

from np_drake.diagnosis.result import UNKNOWN
from np_drake.vehicle import Vehicle

WINDS = ("constant_wind", "gusty_wind")
DRAG = "linear_drag"
DRAGS = (DRAG, "quadratic_drag")
PAYLOAD, GROUND = "suspended_payload", "ground_effect"
PLACE = "place"  # finding of the unknown: a slow force that is tied to a place
NAMED = 0.5  # probability above which a cause counts as named [1]
SURE = 0.9  # probability at which a name is claimed [1]


@dc.dataclass(frozen=True)
class Known:
    """Value of a parameter, and the range that is asked for [SI]."""

    value: float
    low: float
    high: float

    @classmethod
    def within(cls, value: float, error: float) -> "Known":
        """Return a value that is asked for within a relative error.

        Args:
            value: of the parameter [SI].
            error: relative [1].
        """
        return cls(value, value * (1 - error), value * (1 + error))

    def holds(self, value: float | None) -> bool:
        """Return whether a value [SI] is in the range; False for none."""
        return value is not None and self.low <= value <= self.high


@dc.dataclass(frozen=True)
class Truth:
    """Causes of a group of flights; drag is real in all of them.

    false: effects that are not there.
    present: one of these names is the known cause; empty: nothing is attached and no wind blows.
    All others are not known, and are neither right nor wrong: trim, calibration and aerodynamics of
        these vehicles were not measured. parameters: of the known cause.
    healthy: nothing acts but the air and the vehicle's own errors, all flight long, so that what
        begins in flight, and a force that is tied to a place, are not there either.
    """

    source: str
    false: tuple[str, ...]
    present: tuple[str, ...] = ()
    parameters: Mapping[str, Known] = dc.field(default_factory=dict)
    healthy: bool = False

    def holds(self, name: str, late: Collection[str] = ()) -> bool | None:
        """Return whether an effect is there; None where it is not known."""
        if self.healthy and (name in late or name == PLACE):
            return False
        if name == DRAG or name in self.present:
            return True
        return False if name in self.false else None

    def right(self, causes: Mapping[str, float], late: Collection[str] = ()) -> bool:
        """Return whether the known cause is named, where there is one, and none is that is not
        there.

        Args:
            causes: probability by name [1].
        """
        found = not self.present or any(name in self.present for name in named(causes))
        return found and not self.wrong(causes, late)

    def wrong(self, causes: Mapping[str, float], late: Collection[str] = ()) -> list[str]:
        """Return the named causes that are not there.

        Args:
            causes: probability by name [1].
        """
        return [name for name in named(causes) if self.holds(name, late) is False]

    def judged(
        self, causes: Mapping[str, float], late: Collection[str] = ()
    ) -> list[tuple[float, bool]]:
        """Return probability and truth of every cause of which it is known whether it is there.

        Args:
            causes: probability by name [1].
        """
        found = [(p, self.holds(name, late)) for name, p in causes.items()]
        return [(p, holds) for p, holds in found if holds is not None]


def named(causes: Mapping[str, float]) -> list[str]:
    """Return the names of causes with a probability above one half, from probabilities [1] by
    name.
    """
    return [name for name, p in causes.items() if p > NAMED]


INDOORS = (
    PAYLOAD,
    *WINDS,
    GROUND,
)  # not there where nothing is attached, nothing blows and the ground is far


def healthy(source: str, *more: str) -> Truth:
    """Return the truth of flights indoors, with nothing attached."""
    return Truth(
        f"{source}: nothing attached, indoors, no fan; drag is real.",
        (*INDOORS, *more),
        healthy=True,
    )


def hanging(source: str, mass: float, length: float, *more: str) -> Truth:
    """Return the truth of flights indoors with a payload.

    Args:
        mass: of the payload, asked for within 10 % [kg].
        length: of the pendulum, asked for within 5 % [m].
    """
    parameters = {"mass": Known.within(mass, 0.10), "length": Known.within(length, 0.05)}
    return Truth(source, (*WINDS, GROUND, *more), (PAYLOAD,), parameters)


def near_ground(source: str, vehicle: Vehicle) -> Truth:
    """Return the truth of flights near the ground: the law of Cheeseman and Bennett 1955, within
    half and twice.

    The law adds s / (1 - s) of the thrust, s = (R / 4h)². Near h = 2 R and above, s is below 2 %
    and the addition goes with R²: half to twice of it is a radius between 1 / sqrt(2) and sqrt(2)
    times the true one. The law is that of one rotor; four act as one of the same area, R = 2 rotor
    radii, which is the prior of the effect as well.
    """
    radius = 2.0 * vehicle.rotor_radius
    known = Known(radius, radius / math.sqrt(2), radius * math.sqrt(2))
    return Truth(source, (PAYLOAD, *WINDS), (GROUND,), {"effective_radius": known})


IMRC = "IMRCLab crazyflie-data-collection"
IMRC_PAYLOAD = hanging(
    f"{IMRC}: 4.7 g on a string. Length: the logged path of the payload, driven by the "
    f"motion of the vehicle, is that "
    "of a pendulum of 0.493 to 0.501 m; straight from hook to payload it is 0.514 to 0.521 "
    "m. Indoors, no fan.",
    0.0047,
    0.497,
)
CRAZYSWARM2 = "IMRCLab crazyswarm2-tools"
CRAZYSWARM2_PAYLOAD = hanging(
    (
        f"{CRAZYSWARM2}: 5 g on a thread; the logged path of the payload is 0.50 to 0.51 m "
        f"below. Indoors, no fan."
    ),
    0.005,
    0.505,
)
NEURAL_SWARM = "Neural-Swarm, neither fan nor payload"
DOWNWASH = Truth(
    (
        f"{NEURAL_SWARM}: another vehicle passes above and below, whose log is given; the "
        f"ground is 0.4 m away and more."
    ),
    false=(PAYLOAD, "constant_wind", GROUND),
    present=("downwash",),
)
DOWNWASH_ALONE = Truth(
    f"{NEURAL_SWARM}: another vehicle passes above and below, whose log is not given, so "
    f"that no effect can be its "
    "downwash, which comes and goes as gusts do; the ground is 0.4 m away and more.",
    false=(PAYLOAD, "constant_wind", GROUND),
    present=(UNKNOWN,),
)
NOT_BEFORE_FANS = (PAYLOAD, GROUND, "mass_error", "clock_offset")  # not there
WIND = Truth(
    "Neural-Fly: fan array along -x at the vehicle; the file name tells the wind, 100wind "
    "= 12.1 m/s. Mean force of "
    "the wind: mean residual force less that of still air with the same controllers.",
    false=NOT_BEFORE_FANS,
    present=WINDS,
)
STILL_AIR = Truth("Neural-Fly: fans off (nowind).", (*NOT_BEFORE_FANS, *WINDS), healthy=True)
NEW_WIND = Truth(
    "Neural-Fly: the flights that are fitted have no wind; that which judges has.",
    (*NOT_BEFORE_FANS, *WINDS),
)

DIRECTION = (-1.0, 0.0)  # of the wind of the fans in the plane [1]
WITHIN_ANGLE = 10.0  # of that direction [deg]
WITHIN_FORCE = 0.15  # of the mean force of the wind [1]
WITHIN_SPEED = 0.30  # of its speed [1]
LINEAR_UP_TO = 6.0  # wind to which linear drag holds, and the speed is asked for [m/s]
WITHIN_POSITION = 0.06  # RMSE of the payload's position [m]
EXCLUDED_BESIDE_WIND = ("mass_error", "clock_offset")
