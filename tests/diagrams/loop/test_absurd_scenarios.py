"""No number of a scenario leads into an endless run, an exhausted memory or a traceback."""

import time
import typing

import numpy as np
import pytest

from diagrams.loop.flight import FlightConfig, load_flight
from np_drake.files.yaml_file import fields_of

ABSURD = (".nan", ".inf", "-.inf", "1e300", "-1e300", "1e16")


def numbers(kind, default, path=()):
    """Path and default of every number, and list of numbers, of a scenario."""
    for field, inner in fields_of(kind).items():
        value, parts = getattr(default, field, None), typing.get_args(inner)
        if type(None) in parts:
            inner = parts[0]
        if fields_of(inner):
            yield from numbers(inner, value, (*path, field))
        elif inner in (float, int) or (
            typing.get_origin(inner) is list and typing.get_args(inner)[0] in (float, int)
        ):
            yield (*path, field), value


FIELDS = dict(numbers(FlightConfig, FlightConfig()))


def scenario(path, text):
    """A scenario that names one field alone."""
    lines = ["  " * i + f"{name}:" for i, name in enumerate(path)]
    return "\n".join(lines) + f" {text}\n"


@pytest.mark.parametrize("path", FIELDS, ids=".".join)
def test_no_absurd_number_is_flown(tmp_path, path):
    for absurd in ABSURD:
        value = FIELDS[path]
        if absurd == ".inf" and value == np.inf:
            continue
        rest = [str(float(v)) for v in np.ravel(value)[1:]] if isinstance(value, list) else None
        text = absurd if rest is None else f"[{', '.join([absurd, *rest])}]"
        (tmp_path / "s.yaml").write_text(scenario(path, text))
        with pytest.raises(ValueError, match=r"s\.yaml: not a scenario file") as found:
            load_flight(str(tmp_path / "s.yaml"))
        assert "\n" not in str(found.value)
        assert path[-1] in str(found.value)


@pytest.mark.parametrize(
    "text, field",
    [
        ("duration: 1e9", "duration"),
        ("reference: {ramp: 1e9}", "duration"),
        ("controller: {mpc: {horizon: 100000}}", "horizon"),
        ("controller: {mpc: {step: 1e6}}", "step"),
        ("controller: {period: 1e-9}", "period"),
        ("simulator: {max_step_size: 1e-12}", "step"),
    ],
)
def test_no_flight_takes_forever_or_the_whole_memory(tmp_path, text, field):
    (tmp_path / "s.yaml").write_text(text)
    start = time.process_time()
    with pytest.raises(ValueError, match=field):
        load_flight(str(tmp_path / "s.yaml"))
    assert time.process_time() - start < 5.0  # [s]
