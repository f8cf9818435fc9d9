import dataclasses as dc
import math
import time

import pytest

from np_drake.files.yaml_file import POSITIVE, check_fields, load_checked, number, read_yaml, word


@dc.dataclass
class Inner:
    weight: float = 1.0
    place: list[float] = dc.field(default_factory=lambda: [0.0, 1.0])


@dc.dataclass
class Outer:
    speed: float = 1.0
    first: Inner = dc.field(default_factory=Inner)
    many: list[Inner] = dc.field(default_factory=list)
    count: int = 3
    name: str = "one"
    asked: bool = False
    turn: list[list[float]] = dc.field(default_factory=lambda: [[1.0, 0.0], [0.0, 1.0]])

    def check(self) -> "Outer":
        return self


def said(tmp_path, text: str) -> str:
    file = tmp_path / "x.yaml"
    file.write_text(text)
    with pytest.raises(ValueError, match="not a thing") as found:
        load_checked(Outer, file, "thing")
    message = str(found.value)
    assert "\n" not in message
    assert message.startswith(str(file))
    return message


@pytest.mark.parametrize(
    "text, end",
    [
        ("sped: 2.0", "'sped' is an unknown field; did you mean speed?"),
        ("first: {wieght: 2.0}", "'first.wieght' is an unknown field; did you mean weight?"),
        ("many: [{weigth: 2.0}]", "'many[0].weigth' is an unknown field; did you mean weight?"),
        ("xyz: 1", "; known are speed, first, many, count, name, asked, turn."),
        ("", "it is empty; at least one field must be named."),
        (
            "speed: 2.0\ncount: 3\n'speed': 2.0",
            "speed must stand once; it stands in lines 1 and 3.",
        ),
        (
            "many: [{}, {weight: 1.0,\n weight: 2.0}]",
            "must stand once; it stands in lines 1 and 2.",
        ),
    ],
)
def test_a_wrong_field_is_answered_with_a_remedy(tmp_path, text, end):
    assert said(tmp_path, text).endswith(end)


def test_what_the_file_does_not_name_keeps_its_default(tmp_path):
    (tmp_path / "x.yaml").write_text("first: &a {weight: 3.0}\nmany: [*a, {<<: *a, weight: 4}]")
    dut = load_checked(Outer, tmp_path / "x.yaml", "thing")
    assert (dut.speed, dut.first, dut.many) == (1.0, Inner(3.0), [Inner(3.0), Inner(4.0)])


INNER = "fields with their values (weight, place)"
TURN = "a matrix, rows of as many numbers each, as [[1.0, 0.0], [0.0, 1.0]]"


@pytest.mark.parametrize(
    "text, reason",
    [
        ("speed: fast", "speed must be a number; got 'fast'."),
        ("speed: true", "speed must be a number; got True."),
        ("speed:", "speed must be a number; got nothing."),
        (f"speed: 1{'0' * 400}", f"speed must be a number; got 1{'0' * 57} …."),
        ("count: 1.5", "count must be a whole number; got 1.5."),
        ("count: .inf", "count must be a whole number; got inf."),
        ("name: 3", "name must be text (in quotes where it reads as a number); got 3."),
        ("asked: 3", "asked must be true or false; got 3."),
        ("first: 0.1", f"first must be {INNER}; got 0.1."),
        ("first:", f"first must be {INNER}; got nothing."),
        ("first: {weight: [1]}", "first.weight must be a number; got [1]."),
        ("first: {place: 3}", "first.place must be a list of numbers, as [0.0, 1.0]; got 3."),
        ("first: {1: 2}", "the name of a field of first must be text; got 1."),
        ("many: 3", "many must be a list; got 3."),
        ("many: [{}, {weight: x}]", "many[1].weight must be a number; got 'x'."),
        ("turn: [[1, 2], [3]]", f"turn must be {TURN}; got [[1, 2], [3]]."),
        ("turn: &a [*a]", f"turn must be {TURN}; got [[[[[...]]]]]."),
    ],
)
def test_a_value_of_another_kind_is_told_with_field_asked_and_given(tmp_path, text, reason):
    assert said(tmp_path, text).endswith(f": not a thing: {reason}")


def test_a_number_may_be_written_as_yaml_takes_for_text(tmp_path):
    (tmp_path / "x.yaml").write_text(
        "speed: 1e-5\ncount: '4'\nmany: [{weight: 3}]\n_hidden: {1: 2}"
    )
    dut = load_checked(Outer, tmp_path / "x.yaml", "thing")
    assert (dut.speed, dut.count, dut.many) == (1e-5, 4, [Inner(3.0)])


LAUGHS = "_a0: &a0 [x, x, x, x, x, x, x, x, x]\n" + "".join(
    f"_a{i}: &a{i} [{', '.join([f'*a{i - 1}'] * 9)}]\n" for i in range(1, 10)
)


@pytest.mark.parametrize(
    "text, reason",
    [
        (f"{LAUGHS}turn: *a9", "turn must be a matrix"),
        (f"{LAUGHS}many: *a9", "many[0] must be fields with their values"),
        ("speed: " + "[" * 20_000 + "]" * 20_000, "nested"),
        ("speed: " + "{a: " * 3000 + "1" + "}" * 3000, "nested"),
        ('speed: !!python/object/apply:os.system ["true"]', "tag"),
        ("speed: !foo bar", "tag"),
        ("#" * 10**6 + "\n", "must hold at most 1 MB"),
    ],
)
def test_no_text_takes_long_or_makes_an_object_of_another_program(tmp_path, text, reason):
    start = time.process_time()
    assert reason in said(tmp_path, text)
    assert time.process_time() - start < 2.0  # [s]; a reader without bounds never ends


def test_bytes_that_are_no_text_are_refused(tmp_path):
    (tmp_path / "a.yaml").write_bytes(b"a: \xff\xfe")
    with pytest.raises(ValueError, match="UTF-8"):
        read_yaml(tmp_path / "a.yaml")


@dc.dataclass
class Bounded:
    size: float = number(1.0, "m", POSITIVE)
    delay: float | None = number(None, "s", 0.0, 1.0)
    place: list[float] = number([0.0, 0.0], "m", -1.0, 2.0)
    kind: str = word("one", "one", "two")
    parts: int = number(1, "1", 1, 9)


@pytest.mark.parametrize(
    "change, reason",
    [
        ({"size": 0.0}, "size must be positive and finite [m]; got 0.0."),
        ({"size": math.inf}, "size must be positive and finite [m]; got inf."),
        ({"delay": 1.5}, "delay must be 0 to 1 [s]; got 1.5. Is it in s?"),
        ({"delay": math.nan}, "delay must be 0 to 1 [s]; got nan. Is it in s?"),
        ({"place": [0.0]}, "place must be 2 numbers, each -1 to 2 [m]; got [0.0]."),
        ({"place": [0.0, 3.0]}, "place must be 2 numbers, each -1 to 2 [m]; got [0.0, 3.0]."),
        ({"kind": "three"}, "kind must be one of one, two; got 'three'."),
        ({"size": "a"}, "size must be positive and finite [m]; got 'a'."),
        ({"size": True}, "size must be positive and finite [m]; got True."),
        ({"size": 10**400}, "size must be positive and finite [m]; got 10"),
        ({"place": [[0.0], [0.0, 1.0]]}, "place must be 2 numbers, each -1 to 2 [m]; got [[0.0]"),
        ({"parts": 2.5}, "parts must be 1 to 9, a whole number [1]; got 2.5."),
        ({"parts": True}, "parts must be 1 to 9, a whole number [1]; got True."),
    ],
)
def test_a_value_outside_its_bounds_is_told_with_them(change, reason):
    check_fields(Bounded(delay=1.0, place=[-1.0, 2.0]), "thing")
    with pytest.raises(ValueError) as found:
        check_fields(dc.replace(Bounded(), **change), "thing")
    assert str(found.value).startswith(f"thing: {reason}")
