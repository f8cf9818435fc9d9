"""Laws of blackbox logs: what was written is read, and damage is passed over."""

import contextlib
from functools import partial

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from np_drake.logs.errors import LogError
from np_drake.logs.formats.blackbox import BLACKBOX
from np_drake.logs.formats.format import Recording, StatedBreak
from tests.np_drake.logs.formats import blackbox_writer as writer
from tests.np_drake.logs.formats.made_files import read

SIZES = {
    0: 1,
    1: 1,
    3: 1,
    6: 1,
    7: 3,
    8: 4,
    10: 3,
}  # fields that an encoding takes together; 6 as many as follow
# Values of which two differ, and are foreseen, by no more than the encoding holds.
LARGEST = {3: 900, 8: 4000}


everything = partial(read, BLACKBOX)


def plain(rows=64, seed=1, **options):
    """Return a log of a few fields."""
    rng = np.random.default_rng(seed)
    return writer.main_log(
        {name: rng.integers(-500, 500, rows) for name in ("x", "motor[0]", "y")}, **options
    )


def main_rows(found: Recording) -> np.ndarray:
    return np.column_stack([*found.streams["main"].columns.values()])


@st.composite
def logs(draw):
    """Draw a log of every encoding and predictor, and the values of its fields."""
    fields = [writer.ITERATION, writer.TIME, writer.Field("motor[0]", 1, (11, 1), (3, 0))]
    rows = draw(st.integers(1, 12))
    columns = [st.integers(0, 2047)]
    for block in range(draw(st.integers(1, 4))):
        size = draw(st.sampled_from([1, 3, 4]))
        pair = [
            draw(st.sampled_from([e for e, s in SIZES.items() if s in (1, size)])) for _ in "ip"
        ]
        predictors = [
            draw(st.sampled_from([0, 4, 5, 8, 9, 11])),
            draw(st.sampled_from([0, 1, 2, 3, 4, 5, 8, 9, 11])),
        ]
        signed = draw(st.integers(0, 1))
        most = min(LARGEST.get(e, 2**31 - 1) for e in pair)
        small = draw(st.sampled_from([most, min(most, 40), 1]))
        for i in range(size):
            own = writer.Field(f"f{block}[{i}]", signed, *zip(predictors, pair, strict=True))
            fields.append(own)
            columns.append(st.integers(-small * signed, small))
    if draw(st.booleans()):
        fields.append(writer.Field("held", 1, (0, 0), (1, 9)))
        columns.append(st.just(draw(st.integers(-9, 9))))
    values = [[draw(column) for column in columns] for _ in range(rows)]
    time = np.cumsum([draw(st.integers(0, 5000)) for _ in range(rows)]) + draw(
        st.sampled_from([0, 2**31, 2**32 - 9000])
    )
    table = np.column_stack([np.arange(rows), time % 2**32, values])
    return writer.Log(fields, table, interval=draw(st.sampled_from([1, 4, 32]))), time


@settings(max_examples=150, deadline=None)
@given(data=st.data())
def test_every_encoding_and_predictor_keeps_its_values(log, data):
    made, time = data.draw(logs())
    writer.write(log, made)
    dut = everything(log)
    assert dut.notes == ()
    assert np.array_equal(main_rows(dut), np.delete(made.rows, 1, axis=1))
    assert dut.streams["main"].t == pytest.approx(time * 1e-6, abs=1e-9)


@pytest.mark.parametrize(
    ("encoding", "bits"), [(0, 32), (1, 31), (3, 14), (6, 32), (7, 32), (8, 16), (10, 32)]
)
def test_numbers_of_every_size_are_told_apart(log, encoding, bits):
    edges = [
        0,
        *(
            sign * (1 << k) - (sign > 0)
            for k in range(bits)
            for sign in (1, -1)
            if encoding != 1 or sign > 0
        ),
    ]
    fields = [
        writer.ITERATION,
        writer.TIME,
        *(writer.Field(f"f{i}", 1, (0, encoding)) for i in range(12)),
    ]
    rng = np.random.default_rng(2)
    near = [[edge, *rng.choice(edges[: 1 + 2 * (i // 2 + 1)], 11)] for i, edge in enumerate(edges)]
    values = np.array([np.roll(row, k) for row in near for k in range(4)])
    values[values == -(1 << 13)] += encoding == 3  # its opposite takes a bit more
    times = np.arange(len(values))
    writer.write(log, writer.Log(fields, np.column_stack([times, times, values]), interval=1))
    assert np.array_equal(main_rows(everything(log))[:, 1:], values)


@pytest.mark.parametrize(
    ("every", "logged"), [("4", [0, 4, 8, 12]), ("1/2", range(0, 16, 2)), ("2/3", None), ("0", [0])]
)
def test_loops_that_are_not_logged_are_counted(log, every, logged):
    if logged is None:  # two of three, counted within sixteen
        logged = [i for i in range(16) if (i % 16 + 1) % 3 < 2]
    logged = np.concatenate([np.array(logged) + begin for begin in (0, 16, 32)])
    made = writer.Log(
        [writer.ITERATION, writer.TIME],
        np.column_stack([logged, 500 * logged]),
        interval=16,
        every=every,
    )
    writer.write(log, made)
    assert np.array_equal(everything(log).streams["main"].columns["loopIteration"], logged)


def test_events_of_every_kind_are_passed_over(log):
    made = plain(beside={4 + i: [event] for i, event in enumerate(writer.EVENTS.values())})
    writer.write(log, made)
    dut = everything(log)
    assert dut.notes == ()
    assert len(dut.streams["main"]) == len(made.rows)


@pytest.mark.parametrize("told", [True, False])
def test_a_pause_is_a_gap_in_time_where_the_log_tells_it(log, told):
    made = plain()
    made.rows[32:, :2] += [64_000, 600_000_000]  # 10 minutes
    made.beside = {31: [writer.resumed(64_032, 1_064_000 + 600_000_000)]} if told else {}
    writer.write(log, made)
    dut = everything(log)
    assert (
        np.diff(dut.streams["main"].t).max() == pytest.approx(600.002)
        if told
        else len(dut.streams["main"]) == 32
    )


@settings(max_examples=60, deadline=None)
@given(st.data())
def test_a_damaged_place_costs_rows_up_to_the_next_whole_frame(log, data):
    made = plain(rows=200)
    frames = made.frames()
    header, place = len(made.header()), data.draw(st.integers(5, 150))
    at = header + sum(map(len, frames[:place]))
    wrong = data.draw(
        st.binary(min_size=1, max_size=40).filter(
            lambda b: b"End of log" not in b and b"H Product" not in b
        )
    )
    content = made.encode()
    log.write_bytes(content[:at] + wrong + content[at + len(frames[place]) :])
    dut = everything(log)
    found = {int(row[0]): row for row in main_rows(dut)}
    # The frame before it is not known to be whole; at most one I frame behind it is doubted.
    whole = [*range(place - 1), *range(32 * (place // 32 + 2), 200)]
    for i in whole:
        assert np.array_equal(found[i], np.delete(made.rows[i], 1))


def test_a_log_cut_anywhere_keeps_its_whole_frames(log):
    made = plain(rows=40)
    content = made.encode()
    for cut in range(0, len(content), 7):
        log.write_bytes(content[:cut])
        with contextlib.suppress(LogError):
            dut = everything(log)
            rows = main_rows(dut)
            assert np.array_equal(rows, np.delete(made.rows[: len(rows)], 1, axis=1))
            (note,) = dut.notes
            assert "no end" in note


def test_logs_of_one_file_follow_each_other(log):
    first, second = plain(), plain(rows=80, seed=2, begin=400_000)
    writer.write(log, first, second)
    dut = everything(log)
    assert np.array_equal(
        main_rows(dut), np.delete(np.concatenate([first.rows, second.rows]), 1, axis=1)
    )
    assert dut.streams["main"].t[64] == pytest.approx(0.4)
    assert any("2 logs" in line for line in dut.notes)


@pytest.mark.parametrize(("begin", "count"), [(3_000_000, 1), (1_050_000, 0)])
def test_a_later_log_begins_with_a_break_unless_its_clock_is_set_back(log, begin, count):
    writer.write(log, plain(), plain(seed=2, begin=begin))
    assert everything(log).breaks == (StatedBreak(begin / 1e6, "another log begins"),) * count


def test_a_log_of_other_scales_is_left_out(log):
    writer.write(log, plain(), plain(rows=80, settings={"acc_1G": "4096"}))
    dut = everything(log)
    assert len(dut.streams["main"]) == 80
    assert any("logs 1 of 2" in line for line in dut.notes)


@pytest.mark.parametrize(
    ("wrong", "by", "said"),
    [
        (b"Data version:2", b"Data version:1", "Data version must be 2"),
        (b"Field I encoding:1", b"Field I encoding:5", "Field I encoding must be of 0, 1, 3"),
        (b"Field I predictor:0", b"Field I predictor:77", "Field I predictor must be of"),
        (b"Field P predictor:6,", b"Field P predictor:", "Field P predictor must have 5 numbers"),
        (b"loopIteration", b"loopIterations", "must have loopIteration and time"),
        (b"H Field I name", b"H Field J name", "must tell name, predictor and encoding"),
        (b"I interval:32", b"I interval:0", "intervals|must be numbers of loops"),
        (b"P interval:1", b"P interval:x", "must be numbers of loops"),
    ],
)
def test_a_damaged_header_is_refused_in_one_line(log, wrong, by, said):
    content = plain().encode()
    assert wrong in content
    log.write_bytes(content.replace(wrong, by, 1))
    with pytest.raises(LogError, match=said) as refused:
        BLACKBOX.contents(log)
    assert "\n" not in str(refused.value)
