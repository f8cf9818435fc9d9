"""Laws of ranges: an input in a wrong unit is refused with the units there are, one in its own is not."""

import numpy as np
import pytest

from np_drake.logs.errors import LogError
from np_drake.logs.importing.log_map import LogMap, Source
from np_drake.logs.importing.ranges import require_ranges

HOVER = np.linspace(0.3, 0.8, 100)[:, None]


@pytest.mark.parametrize(
    ("name", "factor", "message"),
    [
        ("throttle", 1000.0, "above 1.5 in flight.*percent, us, pwm16"),
        ("throttle", 100.0, "above 1.5 in flight"),
        ("throttle", -1.0, "below -0.05 in flight.*scale"),
        ("hover_throttle", 0.0, "below 0.02 in flight"),
        ("hover_throttle", 100.0, "above 1.5 in flight"),
        ("voltage", 1e4, "above 1000 in flight.*mV"),
        ("rotor_speed", 2e4, "above 5000 in flight.*rpm"),
    ],
)
def test_an_input_in_another_unit_is_refused(name, factor, message):
    log_map = LogMap(**{name: Source(["c"])})
    require_ranges({name: HOVER * {"rotor_speed": 1e3, "voltage": 16}.get(name, 1)}, log_map, "flight.csv")
    with pytest.raises(LogError, match=rf"flight.csv, {name} \(c\): must not be {message}"):
        require_ranges({name: HOVER * factor}, log_map, "flight.csv")


def test_a_few_odd_values_are_no_other_unit():
    throttle = np.tile(HOVER, (50, 1))
    throttle[0] = 1000.0
    require_ranges({"throttle": throttle}, LogMap(throttle=Source(["c"])), "flight.csv")
