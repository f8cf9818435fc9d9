"""Laws of forms, and of those of truth.json and diagnosis.json."""

import pytest

from diagrams.challenge.score.answered_case import ANSWER, NUMBER, PARAMETERS, SIZE, TEXT, TRUTH
from diagrams.challenge.score.schema import (
    SchemaValidator,
    list_of,
    object_of,
    or_null,
    record,
    violation,
)

PAIR = record({"a": NUMBER, "b": TEXT}, spare={"c": list_of(SIZE)})
DEEP = SchemaValidator(list_of(object_of(PAIR)))


def schemas(schema):
    """The schema and all that it holds."""
    inner = [*schema.get("properties", {}).values(), *schema.get("patternProperties", {}).values()]
    inner += [schema["items"]] if "items" in schema else []
    return [schema, *(deeper for one in inner for deeper in schemas(one))]


@pytest.mark.parametrize(
    "value",
    [float("nan"), float("inf"), -float("inf"), 10**400, -(10**400), True, "1", None, [1]],
    ids=str,
)
def test_what_is_no_finite_number_is_refused(value):
    assert violation(SchemaValidator(NUMBER), value).startswith("it must be a finite number; got ")


@pytest.mark.parametrize("value", [0, -3, 1.5, 1e308, 10**300])
def test_a_finite_number_suits(value):
    assert violation(SchemaValidator(NUMBER), value) is None


def test_bounds_are_included():
    assert [violation(SchemaValidator(SIZE), value) is None for value in (0, -1e-9)] == [
        True,
        False,
    ]


@pytest.mark.parametrize(
    "value, sentence",
    [
        ([], None),
        ([{"x": {"a": 1, "b": ""}}], None),
        ([{"x": {"a": 1, "b": "", "c": [0], "d": "not read"}}], None),
        ({}, "it must be a list, each an object, each value an object with a, b, c; got {}."),
        ([{}, {"x": 1}], "[1].x must be an object with a, b, c; got 1."),
        ([{"x": {"a": 1}}], "[0].x.b is missing; it must be text."),
        ([{"x": {}}], "[0].x.a is missing; it must be a finite number."),
        ([{"x": {"b": 2}}], "[0].x.b must be text; got 2."),
        (
            [{"x": {"a": 1, "b": "", "c": [0, None]}}],
            "[0].x.c[1] must be a finite number, at least 0; got nothing.",
        ),
        ([{"x\ny": 1}], "[0].x y must be an object with a, b, c; got 1."),
    ],
    ids=str,
)
def test_a_misfit_names_place_what_it_must_be_and_what_it_is(value, sentence):
    assert violation(DEEP, value) == sentence


def test_a_place_given_stands_before_the_one_found():
    assert (
        violation(PARAMETERS, {"m": "x"}, "effects[0]")
        == "effects[0].m must be a finite number; got 'x'."
    )


def test_the_first_misfit_of_the_file_is_named():
    table = {f"k{i}": i if i < 5 else "x" for i in range(50)}
    assert violation(PARAMETERS, table) == "k5 must be a finite number; got 'x'."


def test_null_suits_only_where_it_may_be():
    assert (
        violation(SchemaValidator(PAIR), None) == "it must be an object with a, b, c; got nothing."
    )
    assert violation(SchemaValidator(or_null(PAIR)), None) is None
    assert (
        violation(SchemaValidator(or_null(PAIR)), 3)
        == "it must be an object with a, b, c, or null; got 3."
    )
    assert violation(SchemaValidator(or_null(PAIR)), {"a": 1}) == "b is missing; it must be text."


@pytest.mark.parametrize("form", [TRUTH, ANSWER, PARAMETERS], ids=["truth", "answer", "figures"])
def test_a_form_is_a_json_schema_and_says_of_every_value_what_it_must_be(form):
    SchemaValidator.check_schema(form.schema)
    assert all(schema.get("description") for schema in schemas(form.schema))
