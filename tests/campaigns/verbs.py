"""Verbs of many cases, each with the smallest settings at which a campaign of it can be cut in the
middle.
"""

import dataclasses as dc

SECONDS = frozenset({"seconds"})  # of a record: processor time [s]
FLIGHT = frozenset({"solve_ms", "late_solves", "processor_time"})  # of the summary of a flight


@dc.dataclass(frozen=True)
class Verb:
    """Command line of a verb, where its cases end, and which of its values are times.

    arguments, places: words of the command line; {out}, {neurobem}, {real}, {set} (of a challenge)
    and {arrays} (short made flights in the place of the real ones of {neurobem}) stand for folders.
    finished: pattern of the file that a case ends with, in {out}.
    times: names of values in JSON files that are wall or processor times, or count what lasts
        longer than a period.
    columns, rows: of Markdown tables, that are.
    """

    arguments: str
    places: str = "--out {out} --markdown {out}.md --json {out}.json"
    finished: str = "cases/**/*.json"
    times: frozenset[str] = frozenset()
    columns: tuple[str, ...] = ()
    rows: tuple[str, ...] = ()

    def needs(self, folder: str) -> bool:
        """Return whether the command line names the folder."""
        return f"{{{folder}}}" in self.arguments


VERBS: dict[str, Verb] = {
    "challenge make": Verb(
        "--cases 3 --clean 1 --seconds 5 --seed 11",
        "--out {out}/cases --truth {out}/truth --json {out}.json",
        "cases/[0-9a-f]*/vehicle.yaml",
    ),
    "challenge solve": Verb(
        "{set}/cases", "--out {out}", "*/diagnosis.json", frozenset({"wall", "peak_memory"})
    ),
    "train": Verb(
        "--envelope 3 --epochs 3", "--out {out}/np.safetensors --json {out}.json", "np.safetensors"
    ),
    "reproduce tracking": Verb("--seeds 1 --only np", times=FLIGHT),
    "reproduce gap": Verb("--neurobem {neurobem}"),
    "reproduce estimation": Verb("--neurobem {neurobem}"),
    "reproduce sample-efficiency": Verb("--neurobem {arrays}"),
    "reproduce payload-flights": Verb(
        "{real} --only ridge --only payload_filter", times=frozenset({"wall", "training"})
    ),
    "reproduce hover": Verb("--seeds 2 --only hold", times=FLIGHT),
    "reproduce attach": Verb("--seeds 1", times=FLIGHT),
    "reproduce robustness": Verb("--seeds 1 --only np --axis loss --duration 10", times=FLIGHT),
    "reproduce identification": Verb(
        "--vehicles 2 --flights 1 --seconds 8",
        times=frozenset({"processor_time"}),
        columns=("processor time [s]",),
        rows=("processor time, median",),
    ),
    "reproduce identification-flights": Verb(
        "{real} --only imrc", times=frozenset({"processor_time"}), columns=("processor time [s]",)
    ),
    "reproduce real": Verb("{real} --only wind", columns=("s",), rows=("seconds a case, median",)),
    "reproduce autopilot": Verb("--seeds 1 --duration 10"),
    "reproduce blackbox": Verb("--duration 20"),
    "reproduce node": Verb("--seeds 1"),
    "reproduce replay": Verb("{real} --only wind"),
}
