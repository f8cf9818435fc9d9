"""Next steps: what to measure, fly or change after a diagnosis."""

from np_drake.diagnosis.localisation.manoeuvres import SHOWS, manoeuvre
from np_drake.diagnosis.report.summary import main_remainder, named_causes
from np_drake.diagnosis.report.words import capital, described, listed, name_of
from np_drake.diagnosis.result import UNKNOWN, Cause, Diagnosis

LOOSE = 0.5  # half-width of an interval over the value, above which it is loose [1]; own choice
CHECKS = {  # effect: how to see it without a flight
    "mass_error": "weigh the vehicle with its battery",
    "center_of_mass_offset": "balance the vehicle on an edge along each axis",
    "suspended_payload": "weigh what hangs below, and measure its tether",
    "thrust_scale": "measure thrust on a stand",
    "thrust_drift": "log the battery's voltage, and look whether it sags",
    "battery_sag": "log the battery's voltage",
    "weak_rotor": "look at this rotor's propeller and motor",
    "motor_lag": "measure the response of a rotor to a step",
    "command_delay": "log rotor speed, and compare it with the command",
    "clock_offset": "synchronise the clocks of state and command",
    "accelerometer_bias": "calibrate the accelerometer",
    "gyro_bias": "calibrate the gyroscope at rest",
    "attitude_bias": "level the IMU, or the frame of the motion capture",
    "constant_wind": "measure the wind, or fly indoors",
    "gusty_wind": "measure the wind, or fly indoors",
}


def next_steps(diagnosis: Diagnosis) -> list[str]:
    """Return what to do next, the most useful first."""
    if diagnosis.cannot_tell:
        tried = [item.manoeuvre for item in diagnosis.check.not_identifiable if item.manoeuvre]
        return [
            f"Fly with more motion in every axis{f', such as: {tried[0]}' if tried else ''}. Diagnose again."
        ]
    causes = named_causes(diagnosis)
    out = [
        f"To check {name_of(c.identifier)}: {CHECKS[c.identifier]}." for c in causes if c.identifier in CHECKS
    ]
    for cause in causes:
        others = cause.indistinguishable_from
        if others:
            between = f"{name_of(cause.identifier)} from {listed([name_of(o) for o in others], 'or')}"
            how = manoeuvre((cause.identifier, *others)).rstrip(".")
            out.append(f"To tell {between}, fly: {how}; or the flight of np-drake next-flight.")
        elif loose := _loose(cause):
            more = SHOWS.get(cause.identifier, "a longer one with more motion")
            out.append(
                f"Intervals of {cause.identifier} are wide ({listed(loose)}); a better flight: {more}."
            )
    if UNKNOWN in diagnosis.verdict and diagnosis.remains:
        out.append(f"Look for the source of what remains: {described(main_remainder(diagnosis.remains))}.")
    if any("not tested" in sentence for sentence in diagnosis.coverage):
        out.append("Hold out a flight that moves like the training flights.")
    if causes:
        them = "it" if len(causes) == 1 else "them"
        out.append(
            f"Add {them} to the simulator with the values of the table, and diagnose new flights with that."
        )
    return [capital(step) for step in out]


def _loose(cause: Cause) -> list[str]:
    """Return the parameters whose interval is wide, if the widest of the effect's values is one of them."""
    wide = {
        name: 0.5 * (p.ci95[1] - p.ci95[0]) > LOOSE * abs(p.value) > 0 for name, p in cause.parameters.items()
    }
    alike = max((abs(p.value) for p in cause.parameters.values()), default=0.0)
    main = [name for name, p in cause.parameters.items() if abs(p.value) == alike]
    return [name for name in wide if wide[name]] if any(wide[name] for name in main) else []
