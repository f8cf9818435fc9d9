import dataclasses as dc

import pytest

from np_drake.yaml_file import load_checked


@dc.dataclass
class Inner:
    weight: float = 1.0


@dc.dataclass
class Outer:
    speed: float = 1.0
    first: Inner = dc.field(default_factory=Inner)
    many: list[Inner] = dc.field(default_factory=list)

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
    [("sped: 2.0", "speed"), ("first: {wieght: 2.0}", "weight"), ("many: [{weigth: 2.0}]", "weight")],
)
def test_a_misspelt_field_is_answered_with_the_one_it_is_like(tmp_path, text, near):
    assert said(tmp_path, text).endswith(f"; did you mean {near}?")


def test_a_field_like_none_is_answered_with_all_there_are(tmp_path):
    assert said(tmp_path, "xyz: 1").endswith("; known are speed, first, many.")


def test_other_errors_have_no_such_remedy(tmp_path):
    for text in ("speed: fast", "- 1", "speed: ["):
        message = said(tmp_path, text)
        assert "known are" not in message
        assert "did you mean" not in message


@pytest.mark.parametrize("text", ["", "# nothing but this"])
def test_an_empty_file_is_said_to_be_empty(tmp_path, text):
    assert said(tmp_path, text).endswith("it is empty; at least one field must be named.")


def test_what_the_file_does_not_name_keeps_its_default(tmp_path):
    (tmp_path / "x.yaml").write_text("first: {weight: 3.0}")
    dut = load_checked(Outer, tmp_path / "x.yaml", "thing")
    assert (dut.speed, dut.first.weight, dut.many) == (1.0, 3.0, [])
