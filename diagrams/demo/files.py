"""Files of the demo: logs, figures, replay pages, report, corrected simulator, and the page that
shows them.
"""

from pathlib import Path

from diagrams.demo.figures import foretold
from diagrams.demo.page import write_index
from diagrams.demo.story import HELD_OUT, LEARNED, Demo
from diagrams.gap import corrected, side_by_side
from diagrams.loop import flight_figures
from diagrams.loop.replay import write_replay
from diagrams.tracking.tracking import TRACKS
from np_drake.diagnosis.report.page import write_report
from np_drake.files.atomic_file import write_bytes
from np_drake.files.figure_file import png
from np_drake.logs.formats.log_file import write_log


def write_demo(demo: Demo, folder: Path) -> Path:
    """Write everything to a folder, and return the path of the page to begin with.
    Raises: OSError: if a file cannot be written.
    """
    pictures = _pictures(demo)
    for name, picture in pictures.items():
        write_bytes(folder / f"{name}.png", picture)
    for flight in (demo.training, *demo.flights):
        write_log(flight.log(), folder / f"{flight.config.name}_{flight.label}.csv")
    simulators = _write_simulators(demo, folder)
    report = write_report(demo.diagnosis, folder, seed=demo.seed, beside=simulators)
    links = {report.name: "Report of the diagnosis", **simulators, **_write_replays(demo, folder)}
    return write_index(demo, pictures, links, folder)


def _pictures(demo: Demo) -> dict[str, bytes]:
    """Return PNG bytes by name."""
    learned = demo.flown(HELD_OUT, LEARNED.kind)
    wrench = png(flight_figures.wrench(learned))
    pictures = {"foretold": png(foretold(demo)), f"{HELD_OUT}_{LEARNED.kind}_wrench": wrench}
    for track in TRACKS:
        flights = [f for f in demo.flights if f.config.name == track]
        title = f"{track} · seed {flights[0].seed}"
        pictures[f"{track}_track"] = png(flight_figures.plane_track(flights, title))
        pictures[f"{track}_errors"] = png(flight_figures.errors(flights, title))
    return pictures


def _write_simulators(demo: Demo, folder: Path) -> dict[str, str]:
    """Write corrected simulator and ghosts, and return the texts of links by file."""
    vehicle = demo.training.config.vehicle
    config = corrected.corrected_simulator(demo.diagnosis, vehicle)
    corrected.write_corrected(config, demo.diagnosis, folder / corrected.FILE)
    side_by_side.write_side_by_side(demo.beside, vehicle, folder / side_by_side.FILE)
    return {
        side_by_side.FILE: f"The {HELD_OUT} beside its simulators",
        corrected.FILE: "Corrected simulator",
    }


def _write_replays(demo: Demo, folder: Path) -> dict[str, str]:
    """Write a page for every flight of NP-MPC, and return the texts of links by file."""
    links = {}
    for track in TRACKS:
        name = f"{track}_{LEARNED.kind}_replay.html"
        write_replay(demo.flown(track, LEARNED.kind), folder / name)
        links[name] = f"NP-MPC on the {track}"
    return links
