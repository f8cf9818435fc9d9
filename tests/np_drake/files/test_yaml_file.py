import dataclasses as dc

import pytest

from np_drake.files.yaml_file import load_checked


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
    "text, near",
    [
        ("sped: 2.0", "speed"),
        ("first: {wieght: 2.0}", "weight"),
        ("many: [{weigth: 2.0}]", "weight"),
    ],
)
def test_a_misspelt_field_is_answered_with_the_one_it_is_like(tmp_path, text, near):
    assert said(tmp_path, text).endswith(f"; did you mean {near}?")


def test_a_field_like_none_is_answered_with_all_there_are(tmp_path):
    assert said(tmp_path, "xyz: 1").endswith(
        "; known are speed, first, many, count, name, asked, turn."
    )


def test_other_errors_have_no_such_remedy(tmp_path):
    for text in ("speed: fast", "- 1", "speed: ["):
        message = said(tmp_path, text)
        assert "known are" not in message
        assert "did you mean" not in message


@pytest.mark.parametrize("text", ["", "# nothing but this"])
def test_an_empty_file_is_said_to_be_empty(tmp_path, text):
    assert said(tmp_path, text).endswith("it is empty; at least one field must be named.")


@pytest.mark.parametrize(
    "text, field, lines",
    [
        ("speed: 2.0\ncount: 3\n'speed': 2.0", "speed", "1 and 3"),
        ("first:\n  weight: 1.0\n  weight: 2.0", "first.weight", "2 and 3"),
        ("many: [{}, {weight: 1.0,\n weight: 2.0}]", "many[1].weight", "1 and 2"),
    ],
)
def test_a_field_that_stands_twice_is_refused_with_its_lines(tmp_path, text, field, lines):
    assert said(tmp_path, text).endswith(
        f": not a thing: {field} must stand once; it stands in lines {lines}."
    )


def test_an_alias_may_stand_as_often_as_it_is_wanted(tmp_path):
    (tmp_path / "x.yaml").write_text("first: &a {weight: 3.0}\nmany: [*a, *a]")
    assert load_checked(Outer, tmp_path / "x.yaml", "thing").many == [Inner(3.0), Inner(3.0)]


def test_what_the_file_does_not_name_keeps_its_default(tmp_path):
    (tmp_path / "x.yaml").write_text("first: {weight: 3.0}")
    dut = load_checked(Outer, tmp_path / "x.yaml", "thing")
    assert (dut.speed, dut.first.weight, dut.many) == (1.0, 3.0, [])


INNER = "fields with their values (weight, place)"
TURN = "a matrix, 2 rows of 2 numbers, as [[1.0, 0.0], [0.0, 1.0]]"


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
        ("first: []", f"first must be {INNER}; got []."),
        ("first: {weight: [1]}", "first.weight must be a number; got [1]."),
        ("first: {place: 3}", "first.place must be a list of numbers, as [0.0, 1.0]; got 3."),
        ("first: {1: 2}", "the name of a field of first must be text; got 1."),
        ("1: 2", "the name of a field must be text; got 1."),
        ("many: 3", "many must be a list; got 3."),
        ("many: [{}, {weight: x}]", "many[1].weight must be a number; got 'x'."),
        ("turn: [1, 2]", f"turn must be {TURN}; got [1, 2]."),
        ("turn: [[1, 2], [3]]", f"turn must be {TURN}; got [[1, 2], [3]]."),
        ("turn: &a [*a]", f"turn must be {TURN}; got [[...]]."),
    ],
)
def test_a_value_of_another_kind_is_told_with_field_asked_and_given(tmp_path, text, reason):
    assert said(tmp_path, text).endswith(f": not a thing: {reason}")


def test_a_file_without_fields_is_answered_with_all_there_are(tmp_path):
    for text in ("- 1", "hello"):
        assert "it must be fields with their values (speed, first, many, " in said(tmp_path, text)


def test_a_number_may_be_written_as_yaml_takes_for_text(tmp_path):
    (tmp_path / "x.yaml").write_text(
        "speed: 1e-5\ncount: '4'\nmany: [{weight: 3}]\n_hidden: {1: 2}"
    )
    dut = load_checked(Outer, tmp_path / "x.yaml", "thing")
    assert (dut.speed, dut.count, dut.many) == (1e-5, 4, [Inner(3.0)])


@pytest.mark.parametrize("error", [AssertionError(), OverflowError("too\nlarge")])
def test_an_error_that_nobody_foresaw_is_one_line_too(tmp_path, monkeypatch, error):
    def check(_):
        raise error

    monkeypatch.setattr(Outer, "check", check)
    said(tmp_path, "speed: 2.0")
