"""Findings: what readers, import, doctor and diagnosis report of a log, by kind.

Where a finding is shown follows from its kind alone (`Kind.shown`); its text is for people.
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
    """What a finding reports; by itself `np-drake import` prints it."""

    shown: Place
    """Where findings of this kind are shown."""

    def __new__(cls, value: str, shown: Place = Place.IMPORT) -> "Kind":
        """Return a member with its value for the sheet of an import."""
        kind = object.__new__(cls)
        kind._value_ = value
        kind.shown = shown
        return kind

    NO_FLIGHT = "no_flight", Place.IMPORT | Place.FLIGHT | Place.FAILURE
    """The vehicle does not fly: nothing can be identified."""
    CONTRADICTION = "contradiction", Place.FAILURE
    """Quantities of the flight contradict each other or its vehicle."""
    DOUBT = "doubt", Place.ANSWER
    """Quantities of the flight agree badly with each other or its vehicle."""
    NO_MULTICOPTER = "no_multicopter", Place.IMPORT | Place.FLIGHT
    """The vehicle has wings, servos or rotors that are not modelled."""
    STRETCH = "stretch", Place.IMPORT | Place.FLIGHT | Place.LIMIT
    """The log agrees with its conventions in one stretch, which is taken."""
    VEHICLE = "vehicle", Place.IMPORT | Place.FLIGHT | Place.ANSWER
    """The vehicle reports a warning or an error."""
    CLIPPING = "clipping", Place.IMPORT | Place.FLIGHT | Place.ANSWER
    """The accelerometer reaches its limit."""
    COARSE_CLOCK = "coarse_clock", Place.FLIGHT | Place.ANSWER
    """Times are rounded so coarsely that answers suffer."""
    ROTOR_ORDER = "rotor_order", Place.ANSWER
    """The rotor columns are not in the order of the vehicle file."""
    COEFFICIENT = "coefficient", Place.ANSWER
    """The thrust coefficient was fitted in place of the file's guess."""
    LOST = "lost", Place.IMPORT | Place.FLIGHT
    """Readings of rotors or of the battery were left out."""
    BRIDGED = "bridged", Place.FLIGHT
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
    THROTTLE = "throttle", Place(0)
    """The map by which thrust comes from throttle."""
    NEIGHBOUR = "neighbour"
    """A vehicle flew nearby."""
    LIMITED = "limited", Place.LIMIT
    """Many rows were bridged, or many rotors at their limit."""
    DETAIL = "detail", Place(0)
    """How a file was read."""


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
    return [finding for finding in findings if finding.kind.shown & place]


def joined(findings: Iterable[Finding]) -> list[Finding]:
    """Return one finding for each kind and text, which names all its flights."""
    flights: dict[tuple[Kind, str], list[str]] = {}
    for finding in findings:
        flights.setdefault((finding.kind, finding.text), []).append(finding.where)
    return [Finding(kind, ", ".join(names), text) for (kind, text), names in flights.items()]
