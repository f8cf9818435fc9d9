"""What is slower than the motion is no input, and telemetry is taken for what it is."""

import numpy as np
import pytest

from np_drake.logs.formats.format import Stream
from np_drake.logs.importing.import_log import import_log
from np_drake.logs.importing.log_map import LogMap, Source

NAMES = {"position": 3, "velocity": 3, "attitude": 4, "rates": 3, "rotor_speed": 4}


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


def table(path, columns: dict[str, np.ndarray], t: np.ndarray, **fields):
    """Write columns as a table, and return the map of it."""
    rows, names, sources = [t], ["t"], {}
    for name, values in columns.items():
        own = [f"{name}{i}" for i in range(values.shape[1])]
        rows += list(values.T)
        names += own
        sources[name] = Source(own)
    np.savetxt(
        path,
        np.stack(rows, axis=1),
        delimiter=",",
        header=",".join(names),
        comments="",
        fmt="%.12g",
    )
    return LogMap(time=Source(["t"]), **sources, **fields)


def quantities(flown, speed: np.ndarray) -> dict[str, np.ndarray]:
    return {
        "position": flown.p,
        "velocity": flown.v,
        "attitude": flown.q,
        "rates": flown.w,
        "rotor_speed": speed,
    }


@pytest.mark.parametrize("tick", [0.004])
def test_ticks_of_a_coarse_clock_are_an_uncertainty_of_time(flown, autopilots, tmp_path, tick):
    speed = 900.0 * autopilots.throttle(flown)
    t = tick * np.floor(flown.t / tick + 1e-9)
    found = import_log(tmp_path / "a.csv", table(tmp_path / "a.csv", quantities(flown, speed), t))
    (dut,) = found.flights
    assert dut.t[-1] == pytest.approx(flown.t[-1], abs=2 * tick)
    assert dut.timing == pytest.approx(tick / np.sqrt(12), rel=1e-3)
    assert any(
        f"times are rounded to {1e3 * tick:.3g} ms" in note for note in found.sheet.content["notes"]
    )
