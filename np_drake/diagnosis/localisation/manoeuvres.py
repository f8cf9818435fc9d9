"""Manoeuvres that would show an effect, or tell two apart."""

SHOWS = {
    "mass_error": "steep climbs and descents with roll and pitch doublets (torque tells thrust from mass)",
    "inertia_error": "fast doublets about all three axes",
    "center_of_mass_offset": "thrust steps: climb and descend hard with level attitude",
    "suspended_payload": "sudden stops that make the payload swing",
    "thrust_scale": "fast roll and pitch doublets: torque scales with thrust, weight does not",
    "thrust_drift": "the same manoeuvre at the start and at the end of a longer flight",
    "weak_rotor": "thrust steps and yaw doublets",
    "motor_lag": "sharp doublets, and a log of rotor speed",
    "command_delay": "sharp doublets, and a log of rotor speed",
    "linear_drag": "sprints at several speeds in both horizontal directions and vertically",
    "quadratic_drag": "sprints at 1, 3 and 6 m/s: the square shows at speed",
    "blade_flapping": "level sprints with sudden reversals",
    "translational_lift": "sprints at constant height, then hover",
    "rotor_inflow": "fast climbs and descents with level attitude, then sprints at constant height",
    "constant_wind": "the same sprint in opposite directions, and with two headings",
    "gusty_wind": "hover for a minute, then fly the same place again",
    "ground_effect": "a descent to below two rotor radii",
    "rotor_gyroscopic": "roll and pitch doublets while yawing hard",
    "accelerometer_bias": "hover with two opposite headings",
    "gyro_bias": "rest on the ground for ten seconds",
    "velocity_bias": "hover in place, then long straight legs",
    "attitude_bias": "hover with two opposite headings, and sprints",
    "clock_offset": "sharp doublets",
}
PAIRS = {
    frozenset(
        ("command_delay", "clock_offset")
    ): "log rotor speed: a delay shows there, a clock offset does not",
    frozenset(
        ("mass_error", "thrust_scale")
    ): "fast roll and pitch doublets: torque scales with thrust, not with mass",
    frozenset(
        ("accelerometer_bias", "attitude_bias")
    ): "fly at several thrusts: tilt scales with thrust, a bias stays",
    frozenset(("linear_drag", "quadratic_drag")): "sprints at 1, 3 and 6 m/s: the square shows at speed",
}


def manoeuvre(effects: tuple[str, ...]) -> str:
    """Return one line that names a manoeuvre for one effect or for a pair."""
    if len(effects) > 1 and frozenset(effects) in PAIRS:
        return PAIRS[frozenset(effects)]
    known = [SHOWS[e] for e in effects if e in SHOWS]
    return (
        "; or ".join(dict.fromkeys(known)) if known else "a flight that excites every axis at several speeds"
    )
