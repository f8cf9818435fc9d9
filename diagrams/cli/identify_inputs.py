"""What `np-drake identify` takes: the vehicle whose geometry is given, and the flights of logs, to
fit and to judge.
"""

from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from np_drake.flight_log import FlightLog
    from np_drake.logs.opening import Opened
    from np_drake.vehicle import Vehicle

READ = 0.3  # share of the bar
LAST = 2 / 3  # share of a single flight that is fitted; own choice
# mass over the cube of the arm [kg/m³], where the mass is not known; nothing but ratios is told
# then
DENSITY = 370.0


def require_different(logs: list[Path], judging: list[Path]) -> None:
    """Check that no log is given twice.
    Raises: ValueError: where one is.
    """
    fitted, held = ([path.resolve() for path in paths] for paths in (logs, judging))
    for path in [*logs, *judging]:
        if [*fitted, *held].count(path.resolve()) > 1:
            both = path.resolve() in fitted and path.resolve() in held
            raise ValueError(
                f"{path}: must be given once; got it "
                f"{'as LOG and as --held-out' if both else 'twice'}."
            )


def prior_of(
    vehicle: Path | None,
    mass: float | None,
    wheelbase: float | None,
    propeller: float | None,
    order: str | None,
    trust: str,
) -> "tuple[Vehicle, float | None]":
    """Return the vehicle whose geometry is given, and its mass; None where it is to be told or is
    not known.

    Args:
        mass: given [kg].
        wheelbase: without a file: from motor to motor, across [m].
        propeller: without a file: diameter [m].
        order: without a file: an autopilot of `rotor_layout.FIRMWARE`.
    Raises: ValueError: where they do not go together.
    """
    from np_drake.vehicle import load_vehicle
    from np_drake.vehicle.estimate import HEAVIEST, LIGHTEST, Measured, estimate
    from np_drake.vehicle.rotor_layout import FIRMWARE

    if trust not in ("mass", "thrust"):
        raise ValueError(f"--trust must be mass or thrust; got {trust!r}.")
    if mass is not None and not LIGHTEST <= mass <= HEAVIEST:
        raise ValueError(f"--mass must be {LIGHTEST:g} to {HEAVIEST:g} kg; got {mass:g}.")
    if mass is not None and trust == "thrust":
        raise ValueError("--trust thrust: tells the mass; leave --mass out.")
    measures = {"--wheelbase": wheelbase, "--propeller": propeller, "--order": order}
    if vehicle is not None:
        if given := [option for option, value in measures.items() if value is not None]:
            raise ValueError(f"--vehicle: holds the rotors' places; leave {', '.join(given)} out.")
        prior = load_vehicle(vehicle)
        return prior, None if trust == "thrust" else mass or prior.mass
    if wheelbase is None:
        raise ValueError(
            "needs the rotors' places: give --vehicle FILE, or --wheelbase M (motor to "
            "motor) and --order."
        )
    if order is None:
        raise ValueError(f"give --order {'|'.join(FIRMWARE)} (whose logs you have) as well.")
    guess = (
        min(max(DENSITY * (0.5 * wheelbase) ** 3, LIGHTEST), HEAVIEST)
        if wheelbase > 0
        else LIGHTEST
    )
    diameter = 0.5 * wheelbase if propeller is None else propeller
    measured = Measured(guess if mass is None else mass, wheelbase, diameter, 0.5, order=order)
    frame = estimate(measured, f"frame of {wheelbase:g} m")
    return frame if mass is not None else _over_mass(frame), mass


def _over_mass(vehicle: "Vehicle") -> "Vehicle":
    """Return the vehicle with mass 1, all forces and moments over its mass."""
    import dataclasses as dc

    m = vehicle.mass
    return dc.replace(
        vehicle,
        mass=1.0,
        inertia=(vehicle.J / m).tolist(),
        thrust_coefficient=vehicle.thrust_coefficient / m,
        torque_coefficient=vehicle.torque_coefficient / m,
        max_rotor_thrust=vehicle.max_rotor_thrust / m,
    ).check()


def open_logs(
    paths: list[Path], vehicle: "Vehicle", log_map: Path | None, advance: Any
) -> "tuple[list[list[FlightLog]], list[str]]":
    """Return the flights of each log, with rotors in the order of the vehicle, and what readers
    derived.
    """
    from np_drake.logs.importing.log_map import load_map_file
    from np_drake.logs.opening import read_as_logged, with_vehicle

    declared = None if log_map is None else load_map_file(log_map)
    read = []
    for number, path in enumerate(paths):
        advance(READ * number / len(paths), f"reading {path.name}")
        read.append(read_as_logged(path, declared))
        _require_turning(read[-1])
    opened = [found.flights for found in with_vehicle(read, vehicle)]
    said: dict[str, list[str]] = {}
    for log in (log for flights in opened for log in flights):
        for note in log.notes:
            said.setdefault(note, []).append(log.name)
    return opened, [f"{', '.join(names)}: {note}" for note, names in said.items()]


def _require_turning(opened: "Opened") -> None:
    """Check that the rotors of a log turn.

    Raises: ValueError: where they do not, with what would tell the vehicle.
    """
    from np_drake.identification.identify import REMEDY

    inputs = [log.rotor if log.rotor is not None else log.throttle for log in opened.flights]
    if all(values is not None and not (values > 0).any() for values in inputs):
        raise ValueError(
            f"{opened.path}: its rotors do not turn, as on a desk, so that it tells "
            f"nothing. {REMEDY}"
        )


def split(
    logs: "list[list[FlightLog]]", judging: "list[FlightLog]"
) -> "tuple[list[FlightLog], list[FlightLog], list[tuple[float, float]], list[str]]":
    """Return flights to fit, those to judge by, the shares of these that count (none: whole), and
    what is left out.

    Args:
        logs: flights of each log to fit; a log with gaps has several.
        judging: of those that are held out; none: the last log, or the last third of a single
            flight.
    """
    from np_drake.identification.identify import SHORTEST, lasts

    flights = [log for found in logs for log in found]
    said = [
        f"{log.name}: shorter than {SHORTEST:g} s; left out"
        for log in [*flights, *judging]
        if lasts(log) < SHORTEST
    ]
    judges = [log for log in judging if lasts(log) >= SHORTEST]
    if judging and not judges:
        raise ValueError(
            f"--held-out: must last {SHORTEST:g} s at least; got {lasts(judging[0]):.2g} s."
        )
    long = [kept for found in logs if (kept := [log for log in found if lasts(log) >= SHORTEST])]
    if not long:
        most = max(map(lasts, flights))
        raise ValueError(
            f"needs a flight of {SHORTEST:g} s at least; the longest lasts {most:.2g} s."
        )
    every = [log for kept in long for log in kept]
    if judges:
        return every, judges, [], said
    if len(every) > 1:
        last = len(long[-1]) if len(long) > 1 else 1
        return every[:-last], every[-last:], [], said
    if LAST * lasts(every[0]) < SHORTEST:
        return every, [], [], [*said, f"{every[0].name}: too short to hold a third of it out"]
    return every, every, [(LAST, 1.0)], said


def fit_to_judge(
    judging: "list[FlightLog]", parts: list[tuple[float, float]], vehicle: "Vehicle", drive: str
) -> "tuple[list[FlightLog], list[str]]":
    """Return the flights that can judge, and a line for each other."""
    from np_drake.identification.identify import unfit
    from np_drake.identification.signals import signals

    kept, said = [], []
    for number, log in enumerate(judging):
        start, stop = parts[number] if parts else (0.0, 1.0)
        reason = unfit(signals(log, vehicle.unmixer, drive).part(start, stop), stop - start)
        if reason:
            said.append(f"{log.name}: {reason}; does not judge")
        else:
            kept.append(log)
    return kept, said
