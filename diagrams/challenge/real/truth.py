"""What is known about the real flights, with its source: causes that are there, may be there, or are not."""

import dataclasses as dc
from collections.abc import Mapping

WINDS = ("constant_wind", "gusty_wind")
DRAG = "linear_drag"
NAMED = 0.5  # probability above which a cause counts as named [1]
SURE = 0.9  # probability at which a name is claimed [1]


@dc.dataclass(frozen=True)
class Known:
    """Value of a parameter [SI], and the relative error that is asked for [1]."""

    value: float
    within: float


@dc.dataclass(frozen=True)
class Truth:
    """Causes of a group of flights; drag is real in all of them.

    false: effects that are not there.   present: one of these names is the known cause; empty: nothing is attached and
    no wind blows.   All others are not known, and are neither right nor wrong: trim, calibration and aerodynamics of
    these vehicles were not measured.
    """

    source: str
    false: tuple[str, ...]
    present: tuple[str, ...] = ()
    parameters: Mapping[str, Known] = dc.field(default_factory=dict)

    def holds(self, name: str) -> bool | None:
        """Return whether an effect is there; None where it is not known."""
        if name == DRAG or name in self.present:
            return True
        return False if name in self.false else None

    def right(self, causes: Mapping[str, float]) -> bool:
        """Return whether the known cause is named, where there is one, and none is that is not there."""
        found = not self.present or any(name in self.present for name in named(causes))
        return found and not self.wrong(causes)

    def wrong(self, causes: Mapping[str, float]) -> list[str]:
        """Return the named causes that are not there."""
        return [name for name in named(causes) if self.holds(name) is False]

    def judged(self, causes: Mapping[str, float]) -> list[tuple[float, bool]]:
        """Return probability and truth of every cause of which it is known whether it is there."""
        return [(p, bool(self.holds(name))) for name, p in causes.items() if self.holds(name) is not None]


def named(causes: Mapping[str, float]) -> list[str]:
    """Return the names of causes with a probability above one half, from probabilities [1] by name."""
    return [name for name, p in causes.items() if p > NAMED]


NOT_BEFORE_FANS = ("suspended_payload", "ground_effect", "mass_error", "clock_offset")  # not there
PAYLOAD = Truth(
    "IMRCLab crazyflie-data-collection: 4.7 g on a string. Length: the logged path of the payload, driven by the "
    "motion of the vehicle, is that of a pendulum of 0.493 to 0.501 m; straight from hook to payload it is "
    "0.514 to 0.521 m. Indoors, no fan.",
    false=(*WINDS, "ground_effect", "command_delay"),
    present=("suspended_payload",),
    parameters={"mass": Known(0.0047, 0.10), "length": Known(0.497, 0.04)},
)
TRUTHS: dict[str, Truth] = {
    "payload": PAYLOAD,
    "payload-command": dc.replace(PAYLOAD, false=(*WINDS, "ground_effect")),  # commands do act later
    "bare": Truth(
        "IMRCLab crazyflie-data-collection: nothing attached, indoors, no fan; drag is real.",
        false=("suspended_payload", *WINDS, "ground_effect", "command_delay"),
    ),
    "wind": Truth(
        "Neural-Fly: fan array along -x at the vehicle; the file name tells the wind, 100wind = 12.1 m/s. Mean "
        "force of the wind: mean residual force less that of still air with the same controllers.",
        false=NOT_BEFORE_FANS,
        present=WINDS,
    ),
    "still": Truth("Neural-Fly: fans off (nowind).", false=(*NOT_BEFORE_FANS, *WINDS)),
    "new-wind": Truth(
        "Neural-Fly: the flights that are fitted have no wind; that which judges has.", false=(*NOT_BEFORE_FANS, *WINDS)
    ),
    "neurobem": Truth(
        "NeuroBEM: indoors, nothing attached; drag is real, other causes are not known.",
        false=("suspended_payload", *WINDS, "ground_effect"),
    ),
}

DIRECTION = (-1.0, 0.0)  # of the wind of the fans in the plane [1]
WITHIN_ANGLE = 10.0  # of that direction [deg]
WITHIN_FORCE = 0.15  # of the mean force of the wind [1]
WITHIN_SPEED = 0.30  # of its speed [1]
LINEAR_UP_TO = 6.0  # wind to which linear drag holds, and the speed is asked for [m/s]
WITHIN_POSITION = 0.06  # RMSE of the payload's position [m]
EXCLUDED_BESIDE_WIND = ("mass_error", "clock_offset")
