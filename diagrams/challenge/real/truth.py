"""What is known about the real flights, with its source: causes that are there, may be there, or are not."""

import dataclasses as dc
from collections.abc import Mapping

WINDS = ("constant_wind", "gusty_wind")
DRAG = "linear_drag"
NAMED = 0.5  # probability above which a cause counts as named [1]
SURE = 0.9  # probability at which a name is claimed [1]


@dc.dataclass(frozen=True)
class Known:
    """Value of a parameter in its unit, and the relative error that is asked for [1]."""

    value: float
    unit: str
    within: float


@dc.dataclass(frozen=True)
class Truth:
    """Causes of a group of flights.

    present: one of these names is the known cause; empty: nothing is attached and no wind blows.
    real: effects that are there as well.   false: effects that are not there.   All others are not known, and are
    neither right nor wrong: trim, calibration and aerodynamics of these vehicles were not measured.
    """

    present: tuple[str, ...]
    real: tuple[str, ...]
    false: tuple[str, ...]
    parameters: Mapping[str, Known] = dc.field(default_factory=dict)
    source: str = ""

    def holds(self, name: str) -> bool | None:
        """Return whether an effect is there; None where it is not known."""
        if name in self.present or name in self.real:
            return True
        return False if name in self.false else None


NO_WIND = (*WINDS, "ground_effect", "command_delay")
PAYLOAD = Truth(
    present=("suspended_payload",),
    real=(DRAG,),
    false=NO_WIND,
    parameters={"mass": Known(0.0047, "kg", 0.10), "length": Known(0.497, "m", 0.04)},
    source="IMRCLab crazyflie-data-collection: 4.7 g on a string. Length: the logged path of the payload, driven by "
    "the motion of the vehicle, is that of a pendulum of 0.493 to 0.501 m; straight from hook to payload it is 0.514 "
    "to 0.521 m. Indoors, no fan.",
)
TRUTHS: dict[str, Truth] = {
    "payload": PAYLOAD,
    "payload-command": dc.replace(PAYLOAD, false=(*WINDS, "ground_effect")),  # commands do act later
    "bare": Truth(
        present=(),
        real=(DRAG,),
        false=("suspended_payload", *NO_WIND),
        source="IMRCLab crazyflie-data-collection: nothing attached, indoors, no fan; drag is real.",
    ),
    "wind": Truth(
        present=WINDS,
        real=(DRAG,),
        false=("suspended_payload", "ground_effect", "mass_error", "clock_offset"),
        source="Neural-Fly: fan array along -x at the vehicle; the file name tells the wind, 100wind = 12.1 m/s. Mean "
        "force of the wind: mean residual force less that of still air with the same controllers.",
    ),
    "still": Truth(
        present=(),
        real=(DRAG,),
        false=("suspended_payload", "ground_effect", "mass_error", "clock_offset", *WINDS),
        source="Neural-Fly: fans off (nowind).",
    ),
    "new-wind": Truth(
        present=(),
        real=(DRAG,),
        false=("suspended_payload", "ground_effect", "mass_error", "clock_offset", *WINDS),
        source="Neural-Fly: the flights that are fitted have no wind; that which judges has.",
    ),
    "neurobem": Truth(
        present=(),
        real=(DRAG,),
        false=("suspended_payload", *WINDS, "ground_effect"),
        source="NeuroBEM: indoors, nothing attached; drag is real, other causes are not known.",
    ),
}

DIRECTION = (-1.0, 0.0)  # of the wind of the fans in the plane [1]
WITHIN_ANGLE = 10.0  # of that direction [deg]
WITHIN_FORCE = 0.15  # of the mean force of the wind [1]
WITHIN_SPEED = 0.30  # of its speed [1]
LINEAR_UP_TO = 6.0  # wind to which linear drag holds, and the speed is asked for [m/s]
WITHIN_POSITION = 0.06  # RMSE of the payload's position [m]
EXCLUDED_BESIDE_WIND = ("mass_error", "clock_offset")


def named(causes: Mapping[str, float], least: float = NAMED) -> list[str]:
    """Return the names of causes with a probability of at least `least`, or above it where that is one half."""
    return [name for name, p in causes.items() if p > NAMED and p >= least]


def right(truth: Truth, causes: Mapping[str, float]) -> bool:
    """Return whether the known cause is named, where there is one, and none is that is not there."""
    names = named(causes)
    found = not truth.present or any(name in truth.present for name in names)
    return found and not wrong(truth, causes)


def wrong(truth: Truth, causes: Mapping[str, float], least: float = NAMED) -> list[str]:
    """Return the named causes that are not there."""
    return [name for name in named(causes, least) if truth.holds(name) is False]


def judged(truth: Truth, causes: Mapping[str, float]) -> list[tuple[float, bool]]:
    """Return probability and truth of every cause of which it is known whether it is there."""
    return [(p, bool(truth.holds(name))) for name, p in causes.items() if truth.holds(name) is not None]
