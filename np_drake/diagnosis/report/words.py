"""Numbers, names and file names as text for people."""

import math

from np_drake.diagnosis.result import Estimate

NAMES = {  # identifier: name of the effect within a sentence
    "mass_error": "a mass error",
    "inertia_error": "an inertia error",
    "center_of_mass_offset": "an offset of the centre of mass",
    "suspended_payload": "a suspended payload",
    "thrust_scale": "a thrust scale",
    "thrust_drift": "a drift of thrust",
    "weak_rotor": "a weak rotor",
    "motor_lag": "motor lag",
    "command_delay": "a command delay",
    "linear_drag": "linear drag",
    "quadratic_drag": "quadratic drag",
    "blade_flapping": "blade flapping",
    "translational_lift": "translational lift",
    "constant_wind": "a constant wind",
    "gusty_wind": "a gusty wind",
    "ground_effect": "ground effect",
    "rotor_gyroscopic": "the rotors' gyroscopic moment",
    "accelerometer_bias": "an accelerometer bias",
    "gyro_bias": "a gyroscope bias",
    "velocity_bias": "a velocity bias",
    "attitude_bias": "an attitude bias",
    "clock_offset": "a clock offset",
    "unknown": "something unknown",
}
NOTHING = "–"
NBSP = "\u00a0"  # a number and its unit stay on one line
_RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


def name_of(identifier: str) -> str:
    """Return the name of an effect with its article; for a user's own effect, its identifier."""
    return NAMES.get(identifier, identifier.replace("_", " "))


def title_of(identifier: str) -> str:
    """Return the name of an effect as a heading."""
    name = name_of(identifier).removeprefix("a ").removeprefix("an ").removeprefix("the ")
    return name[:1].upper() + name[1:]


def listed(names: list[str], last: str = "and") -> str:
    """Join names as in 'x', 'x and y', 'x, y and z'."""
    return f" {last} ".join([", ".join(names[:-1]), names[-1]] if len(names) > 1 else names)


def number(value: float | None, digits: int = 3) -> str:
    """Return a number with significant digits, or with a power of ten where that is shorter; a dash if not finite."""
    if value is None or not math.isfinite(value):
        return NOTHING
    if value == 0:
        return "0"
    power = math.floor(math.log10(abs(value)))
    if -4 <= power < 5:
        return f"{value:.{max(digits - 1 - power, 0)}f}".replace("-", "−")
    mantissa = f"{value / 10.0**power:.{digits - 1}f}".replace("-", "−")
    return f"{mantissa} × 10{str(power).translate(_RAISED)}"


def percent(share: float | None) -> str:
    """Return a share in per cent.

    Near 0 % and 100 % it has a decimal, and a share between the two is never shown as 0 % or 100 %.
    """
    if share is None or not math.isfinite(share):
        return NOTHING
    if 0.9995 <= share < 1:
        return f"> 99.9{NBSP}%"
    if 0 < share < 0.001:
        return f"< 0.1{NBSP}%"
    share = 0.0 if abs(share) < 0.005 and share < 0 else share
    near = 0 < share < 0.0095 or 0.985 < share < 1
    return f"{100 * share:.{1 if near else 0}f}{NBSP}%".replace("-", "−")


def unit_of(unit: str) -> str:
    """Return the unit to write after a number; "" for a dimensionless one."""
    return "" if unit in ("", "1") else unit


def estimate(parameter: Estimate) -> tuple[str, str]:
    """Return value and interval of a parameter as text, with the digits that the interval supports."""
    lower, upper = parameter.ci95
    half = 0.5 * (upper - lower)
    if half == 0 and not parameter.unit and parameter.value == round(parameter.value):
        return str(round(parameter.value)), NOTHING  # a choice, such as the number of a rotor
    if not (math.isfinite(half) and half > 0):
        return number(parameter.value), NOTHING
    decimals = -math.floor(math.log10(0.5 * half))
    if not 0 <= decimals <= 6:
        return number(parameter.value), f"{number(lower)} … {number(upper)}"
    value, low, high = (f"{v:.{decimals}f}".replace("-", "−") for v in (parameter.value, lower, upper))
    return value, f"{low} … {high}"


def onset(time: float, flight: str) -> str:
    """Return when an effect begins in a flight, at `time` [s]; infinite: absent."""
    return f"at {number(time)}{NBSP}s in {flight}" if math.isfinite(time) else f"not in {flight}"


def probability(value: float) -> str:
    """Return a probability in per cent, never 0 % or 100 %."""
    return percent(min(max(value, 1e-9), 1 - 1e-9)) if math.isfinite(value) else NOTHING


def percent_interval(bounds: tuple[float, float]) -> str:
    """Return an interval of a share such as '91 … 97 %', limited to 100 %."""
    lower, upper = (percent(min(bound, 1.0)) for bound in bounds)
    return f"{lower.removesuffix(NBSP + '%')} … {upper}"


def plain_name(name: str, longest: int = 36) -> str:
    """Return a file name for a figure, with characters that fonts lack replaced, and shortened to `longest`."""
    shown = "".join(sign if sign.isprintable() and ord(sign) < 0x250 else "?" for sign in name)
    return shown if len(shown) <= longest else f"{shown[: longest - 10]}…{shown[-9:]}"
