"""Campaigns of real flights: where they lie, what flew, and what is known of it; one entry a
vehicle and condition.
"""

import dataclasses as dc
from pathlib import Path

from diagrams.challenge.real import rules, truth
from diagrams.challenge.real.rules import Rule
from diagrams.challenge.real.truth import Truth
from np_drake.logs.formats.neurobem import AGILE, published_vehicle
from np_drake.vehicle import Vehicle, load_vehicle
from np_drake.vehicle.estimate import Measured, estimate


@dc.dataclass(frozen=True, eq=False)
class Campaign:
    """Flights of one vehicle under one condition.

    group: name of its cases.
    vehicle: key of what flew; campaigns of one key flew one vehicle, or vehicles built alike.
    patterns: of its logs below the folder of the real flights, or below that of NeuroBEM.
    nominal: vehicle as the documents of the data state it.
    rule, most: which cases the files give, and how many of them are taken. map: preset of `import`;
        empty: none is needed.
    height: range of the height that a flight exceeds 95 % of the time [m]; files of other heights
        are not of the campaign.
    pairs: beginnings of the names of logs of one run, each beside the other, where the neighbour's
        log is given.
    """

    group: str
    vehicle: str
    patterns: tuple[str, ...]
    nominal: Vehicle
    truth: Truth
    rule: Rule
    most: int = 4
    map: str = ""
    height: tuple[float, float] | None = None
    of_neurobem: bool = False
    pairs: tuple[tuple[str, str], ...] = ()

    def files(self, real: Path, neurobem: Path | None = None) -> list[Path]:
        """Return the logs that lie there, of any height, by name; hidden ones apart.

        Args:
            neurobem: folder of NeuroBEM; None: there is none.
        """
        root = neurobem if self.of_neurobem else real
        found = (
            {path for pattern in self.patterns for path in root.glob(pattern)}
            if root is not None
            else set()
        )
        return sorted(
            (p for p in found if p.is_file() and not p.name.startswith(".")),
            key=lambda p: (p.name, p),
        )

    def neighbour(self, path: Path) -> Path | None:
        """Return the log of the vehicle that flew beside the one of a log; None where none is
        given.
        """
        for own, other in (*self.pairs, *(pair[::-1] for pair in self.pairs)):
            if path.name.startswith(own):
                return path.with_name(other + path.name.removeprefix(own))
        return None


def _preset(name: str, mass: float, input: str = "command") -> Vehicle:
    """Return a preset with another mass.

    Args:
        mass: as the documents of the data state it [kg].
    """
    return dc.replace(load_vehicle(name).with_mass(mass), input=input).check()


NEURAL_FLY = dc.replace(
    Vehicle(), name="neural_fly", mass=2.53, max_rotor_thrust=15.0, input="normalised"
).check()
SMALL = _preset("crazyflie", 0.033, "normalised")
# Of the frame only its name, Parrot, and the mass are stated; wheelbase and propeller are a guess,
# 125 and 66 mm. The hover throttle is that of the logs' PWM, and thrust over throttle a guess of
# the estimate.
LARGE = dc.replace(
    estimate(Measured(0.067, 0.125, 0.066, 0.6, curve="linear", order="crazyflie"), "parrot_frame"),
    input="normalised",
)
FANS = ("neural_fly/*.csv*",)
PAIRED = ("neural_swarm/downwash/cf5?_*",)
FAR, NEAR = (
    (0.5, float("inf")),
    (0.0, 0.15),
)  # heights at which the ground does not, and does, add a per cent of thrust

CAMPAIGNS = (
    Campaign(
        "payload",
        "imrc brushless",
        ("imrc/payload/*",),
        _preset("crazyflie_brushless", 0.0397, "rotor_speed"),
        dc.replace(truth.IMRC_PAYLOAD, false=(*truth.IMRC_PAYLOAD.false, "command_delay")),
        rules.by_blocks,
        most=8,
    ),
    Campaign(
        "payload-command",
        "imrc brushless",
        ("imrc/payload/*",),
        _preset("crazyflie_brushless", 0.0397),
        truth.IMRC_PAYLOAD,
        rules.across_blocks,
        most=3,
    ),  # commands do act later
    Campaign(
        "bare",
        "imrc brushless",
        ("imrc/bare/*",),
        _preset("crazyflie_brushless", 0.037, "rotor_speed"),
        truth.healthy(truth.IMRC, "command_delay"),
        rules.by_blocks,
    ),
    Campaign(
        "idsia",
        "idsia",
        ("idsia/*.parquet",),
        _preset("crazyflie_brushless", 0.045, "rotor_speed"),
        truth.healthy("IDSIA nanodrone-sysid-benchmark", "command_delay"),
        rules.by_manoeuvre(r"([^_]+)_"),
        map="idsia",
    ),
    Campaign(
        "nanobench",
        "nanobench",
        ("nanobench/dataset_*.csv.gz",),
        _preset("crazyflie", 0.027, "normalised"),
        truth.healthy("NanoBench"),
        rules.by_manoeuvre(r"dataset_([^_]+)_"),
        map="nanobench",
    ),
    Campaign(
        "crazyswarm2-standard",
        "crazyswarm2 standard",
        ("crazyswarm2/standard/log*",),
        _preset("crazyflie", 0.032),
        truth.healthy(truth.CRAZYSWARM2),
        rules.in_circle(),
    ),
    Campaign(
        "crazyswarm2-upgraded",
        "crazyswarm2 upgraded",
        ("crazyswarm2/upgraded/log*",),
        _preset("crazyflie", 0.0375),
        truth.healthy(truth.CRAZYSWARM2),
        rules.in_circle(),
        most=3,
    ),
    Campaign(
        "crazyswarm2-payload",
        "crazyswarm2 standard",
        ("crazyswarm2/payload/log*",),
        _preset("crazyflie", 0.0369),
        truth.CRAZYSWARM2_PAYLOAD,
        rules.in_circle(),
        most=3,
    ),  # 41.9 g with it
    Campaign("wind", "neural_fly", FANS, NEURAL_FLY, truth.WIND, rules.in_wind, most=6),
    Campaign("still", "neural_fly", FANS, NEURAL_FLY, truth.STILL_AIR, rules.in_still_air, most=3),
    Campaign("new-wind", "neural_fly", FANS, NEURAL_FLY, truth.NEW_WIND, rules.into_wind, most=6),
    Campaign(
        "swarm-single-small",
        "neural_swarm small",
        ("neural_swarm/single/*cf5?_*",),
        SMALL,
        truth.healthy(truth.NEURAL_SWARM),
        rules.in_circle(),
        most=3,
        height=FAR,
    ),
    Campaign(
        "swarm-single-large",
        "neural_swarm large",
        ("neural_swarm/single/*cf10?_*",),
        LARGE,
        truth.healthy(truth.NEURAL_SWARM),
        rules.in_circle(),
        most=3,
        height=FAR,
    ),
    Campaign(
        "swarm-ground-small",
        "neural_swarm small",
        ("neural_swarm/ground/*cf5?_*", "neural_swarm/single/*cf5?_*"),
        SMALL,
        truth.near_ground(truth.NEURAL_SWARM, SMALL),
        rules.in_circle(),
        most=3,
        height=NEAR,
    ),
    Campaign(
        "swarm-ground-large",
        "neural_swarm large",
        ("neural_swarm/ground/*cf10?_*", "neural_swarm/single/*cf10?_*"),
        LARGE,
        truth.near_ground(truth.NEURAL_SWARM, LARGE),
        rules.in_circle(),
        most=3,
        height=NEAR,
    ),
    Campaign(
        "swarm-downwash",
        "neural_swarm small",
        PAIRED,
        SMALL,
        truth.DOWNWASH,
        rules.by_vehicle(r"(cf\d+)_"),
        most=2,
        pairs=(("cf50", "cf51"),),
    ),
    Campaign(
        "swarm-downwash-alone",
        "neural_swarm small",
        PAIRED,
        SMALL,
        truth.DOWNWASH_ALONE,
        rules.by_vehicle(r"(cf\d+)_"),
        most=2,
    ),  # the same flights without the log of the other
    Campaign(
        "neurobem",
        "neurobem",
        tuple(f"csv/merged_{name}.csv" for name in AGILE),
        published_vehicle(),
        truth.healthy("NeuroBEM"),
        rules.in_circle(3),
        of_neurobem=True,
    ),
)
GROUPS = tuple(campaign.group for campaign in CAMPAIGNS)
_BY_GROUP = dict(zip(GROUPS, CAMPAIGNS, strict=True))


def campaign_of(group: str) -> Campaign:
    """Return the campaign whose cases have this name."""
    return _BY_GROUP[group]
