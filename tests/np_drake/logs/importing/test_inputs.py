"""What is slower than the motion is no input, and telemetry is taken for what it is."""

import numpy as np
import pytest

from np_drake.logs.formats.format import Stream


def thinned(stream: Stream, rate: float) -> Stream:
    keep = np.arange(0, len(stream), round(100.0 / rate))
    return Stream(stream.t[keep], {name: values[keep] for name, values in stream.columns.items()})


def escs(speed: np.ndarray, t: np.ndarray) -> dict[str, Stream]:
    return {f"ESC.{i}": Stream(t, {"RPM": column}) for i, column in enumerate(speed.T)}


@pytest.mark.parametrize("kind", ["throttle", "rotor_speed"])
def test_motors_seen_ten_times_a_second_tell_thrust_and_no_torque(
    flown, autopilots, import_ardupilot, kind
):
    ours = autopilots.throttle(flown)

    def slow(streams):
        outputs = streams.pop("RCOU")
        if kind == "throttle":
            return streams | {"RCOU": thinned(outputs, 10.0)}
        return streams | {
            n: thinned(s, 10.0) for n, s in escs(9000.0 * ours, flown.t + 1.0).items()
        }

    found = import_ardupilot(1000.0 + 1000.0 * ours, change=slow)
    (dut,) = found.flights
    assert (dut.input, dut.throttle.shape[1], dut.rotor) == ("normalised", 1, None)
    assert (
        f"{kind} at 10 Hz is slower than what turns the vehicle: its collective thrust "
        f"alone is taken"
    ) in " ".join(found.said)
    lift = np.sum(ours**2, axis=1)
    theirs = np.interp(dut.t, flown.t, lift)
    assert np.corrcoef(dut.throttle[20:-20, 0] ** 2, theirs[20:-20])[0, 1] > 0.9
