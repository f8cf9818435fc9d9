"""Findings: what readers, import, doctor and diagnosis report of a log, by kind.

Where a finding is shown follows from its kind alone (`SHOWN`); its text is for people.
"""

import dataclasses as dc
import enum
from collections.abc import Iterable


class Place(enum.Flag):
    """Where findings are shown; the sheet of an import holds all of its own."""

    IMPORT = enum.auto()
    """Printed by `np-drake import`."""
    FLIGHT = enum.auto()
    """Kept with the flights: in `said` of the sheet, and read again with the log."""
    ANSWER = enum.auto()
    """Stated before any answer from the flight."""
    LIMIT = enum.auto()
    """A limit of the flight, in the examination of its log."""
    FAILURE = enum.auto()
    """Before any answer, and the flight is not usable."""


class Kind(enum.Enum):
    """What a finding reports."""

    NO_FLIGHT = "no_flight"
    """The vehicle does not fly: nothing can be identified."""
    CONTRADICTION = "contradiction"
    """Quantities of the flight contradict each other or its vehicle."""
    DOUBT = "doubt"
    """Quantities of the flight agree badly with each other or its vehicle."""
    NO_MULTICOPTER = "no_multicopter"
    """The vehicle has wings, servos or rotors that are not modelled."""
    STRETCH = "stretch"
    """The log agrees with its conventions in one stretch, which is taken."""
    VEHICLE = "vehicle"
    """The vehicle reports a warning or an error."""
    CLIPPING = "clipping"
    """The accelerometer reaches its limit."""
    COARSE_CLOCK = "coarse_clock"
    """Times are rounded so coarsely that answers suffer."""
    ROTOR_ORDER = "rotor_order"
    """The rotor columns are not in the order of the vehicle file."""
    COEFFICIENT = "coefficient"
    """The thrust coefficient was fitted in place of the file's guess."""
    LOST = "lost"
    """Readings of rotors or of the battery were left out."""
    BRIDGED = "bridged"
    """Readings of rotors were interpolated."""
    BREAK = "break"
    """The log is split or ends."""
    LEFT_OUT = "left_out"
    """Rows, columns or streams were left out."""
    DAMAGE = "damage"
    """The file or an estimate in it is not whole."""
    DERIVED = "derived"
    """A quantity was derived from others."""
    CLOCK = "clock"
    """A clock was corrected."""
    INPUT = "input"
    """What thrust and torque come from."""
    THROTTLE = "throttle"
    """The map by which thrust comes from throttle."""
    NEIGHBOUR = "neighbour"
    """A vehicle flew nearby."""
    LIMITED = "limited"
    """Many rows were bridged, or many rotors at their limit."""
    DETAIL = "detail"
    """How a file was read."""


SHOWN = {
    Kind.NO_FLIGHT: Place.IMPORT | Place.FLIGHT | Place.FAILURE,
    Kind.CONTRADICTION: Place.FAILURE,
    Kind.DOUBT: Place.ANSWER,
    Kind.NO_MULTICOPTER: Place.IMPORT | Place.FLIGHT,
    Kind.STRETCH: Place.IMPORT | Place.FLIGHT | Place.LIMIT,
    Kind.VEHICLE: Place.IMPORT | Place.FLIGHT | Place.ANSWER,
    Kind.CLIPPING: Place.IMPORT | Place.FLIGHT | Place.ANSWER,
    Kind.COARSE_CLOCK: Place.FLIGHT | Place.ANSWER,
    Kind.ROTOR_ORDER: Place.ANSWER,
    Kind.COEFFICIENT: Place.ANSWER,
    Kind.LOST: Place.IMPORT | Place.FLIGHT,
    Kind.BRIDGED: Place.FLIGHT,
    Kind.BREAK: Place.IMPORT,
    Kind.LEFT_OUT: Place.IMPORT,
    Kind.DAMAGE: Place.IMPORT,
    Kind.DERIVED: Place.IMPORT,
    Kind.CLOCK: Place.IMPORT,
    Kind.INPUT: Place.IMPORT,
    Kind.THROTTLE: Place(0),
    Kind.NEIGHBOUR: Place.IMPORT,
    Kind.LIMITED: Place.LIMIT,
    Kind.DETAIL: Place(0),
}


@dc.dataclass(frozen=True)
class Finding:
    """One finding.

    where: file, flight, quantity or time to which it belongs; empty: the text names it.
    text: a sentence for people, on which nothing branches.
    """

    kind: Kind
    where: str
    text: str

    def __str__(self) -> str:
        return f"{self.where}: {self.text}" if self.where else self.text

    def of(self, flight: str) -> "Finding":
        """Return the finding with the name of its flight before its line."""
        return Finding(self.kind, flight, str(self))


def shown_at(findings: Iterable[Finding], place: Place) -> list[Finding]:
    """Return the findings that are shown at a place."""
    return [finding for finding in findings if SHOWN[finding.kind] & place]


def joined(findings: Iterable[Finding]) -> list[Finding]:
    """Return one finding for each kind and text, which names all its flights."""
    flights: dict[tuple[Kind, str], list[str]] = {}
    for finding in findings:
        flights.setdefault((finding.kind, finding.text), []).append(finding.where)
    return [Finding(kind, ", ".join(names), text) for (kind, text), names in flights.items()]
