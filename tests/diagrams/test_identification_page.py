"""Laws of the page of an identification."""

import dataclasses as dc
import re

import numpy as np
import pytest

from diagrams.identification_page import (
    agreement_figure,
    half_width,
    headline,
    interval,
    interval_figure,
    not_told,
    place_in_prior,
    residual_figure,
    summary,
    write_page,
)
from np_drake.estimation.map_fit import Agreement
from np_drake.files.number_text import NBSP
from np_drake.identification.flight_agreement import flight_values, own_values
from np_drake.identification.identified_vehicle import identified_vehicle
from np_drake.identification.identify import identify
from np_drake.identification.validation import held_out_errors
from np_drake.vehicle import load_vehicle

TRUE = load_vehicle("crazyflie_brushless")
OTHER = dc.replace(TRUE, thrust_coefficient=0.9 * TRUE.thrust_coefficient)
APART = Agreement(np.array([0.0, 0.02, 2.0, -0.01, 0.01]), np.full(5, 0.05), 0.8, 1e-9)


@pytest.fixture(scope="module")
def flights(excited_flight):
    """Five flights, the third with a tenth less lift, and one more to judge by."""
    made = [
        excited_flight(TRUE if seed != 2 else OTHER, seed, seconds=10.0 if seed < 5 else 6.0)
        for seed in range(6)
    ]
    return made[:5], made[5]


@pytest.fixture(scope="module")
def found(flights):
    """Return the identification from five flights."""
    return identify(flights[0], TRUE, mass=TRUE.mass)


@pytest.fixture(scope="module")
def rows(found, flights):
    """Return the errors on the sixth flight."""
    return held_out_errors(found, [flights[1]])


@pytest.fixture(scope="module")
def folder(found, rows, tmp_path_factory):
    """Return the folder that holds the page."""
    here = tmp_path_factory.mktemp("page")
    assert write_page(found, rows, here) == here / "identification.html"
    return here


def test_the_page_begins_with_the_answer_and_needs_no_network(folder, found):
    page = (folder / "identification.html").read_text()
    first = re.search(r"<h1>(.*?)</h1>", page)
    assert first is not None
    assert first[1].replace("\xa0", " ") == headline(found).replace("\xa0", " ")
    assert page.index("<h1>") < page.index("<h2>")
    assert not re.search(r'(src|href)="(?!data:|vehicle\.yaml)', page)
    pictures = sorted(path.stem for path in folder.glob("*.png"))
    assert pictures == ["agreement", "intervals", "residuals"]
    assert page.count("<img") == 3
    for quantity in found.quantities:
        assert f"<b>{quantity.title}</b>" in page
        assert interval(quantity)[1] in page


def test_the_first_sentence_names_three_numbers_and_which_are_told(found):
    line = headline(found)
    for name in ("thrust coefficient", "inertia xx", "time constant up"):
        if name in {q.name for q in found.quantities}:
            told = "told" if found[name].observable else "not told"
            assert re.search(rf"{name} [^;]*? \(±[^)]*, {told}\)", line), name
    assert line.startswith("5 flights of crazyflie_brushless: ")


def test_what_trades_and_is_doubted_is_said_and_not_listed_as_untold(found):
    z, n = found.estimate.z, found.estimate.layout.names
    covariance = 1e-4 * np.eye(len(z))
    i, k = n.index("com_x"), n.index("gain_pitch")
    covariance[np.ix_([i, k], [i, k])] = [[1.0, -0.99], [-0.99, 1.0]]
    frame = dc.replace(found.basis.frame, radius=0.25 * found.basis.frame.radius)
    dut = dc.replace(
        found,
        estimate=dc.replace(found.estimate, covariances=(covariance,)),
        basis=dc.replace(found.basis, frame=frame),
    )
    said = summary(dut)
    assert [line for line in said if line.startswith("not told apart: centre of mass x against")]
    assert [line for line in said if line.startswith("doubted: thrust coefficient")]
    assert "centre of mass x" not in [name for _, names, _ in not_told(dut) for name in names]


def test_every_number_of_the_figures_can_be_read(found, rows, smallest_text):
    drawn = (
        interval_figure(found),
        agreement_figure(found, flight_values(found)),
        residual_figure(rows),
    )
    assert all(smallest_text(figure) >= 9.0 for figure in drawn)  # [px]


def test_warnings_stand_once_and_at_the_end(found, rows, tmp_path):
    text = write_page(found, rows, tmp_path, warnings=["a, b: late"]).read_text()
    assert text.count("a, b: late") == 1
    assert text.index("a, b: late") > text.index("<h2>Made from</h2>")


def test_the_flight_that_differs_is_named(found, tmp_path):
    estimate = dc.replace(found.estimate, agreement=found.estimate.agreement | {"jxx": APART})
    differing = dc.replace(found, estimate=estimate)
    (inertia,) = (told for told in flight_values(differing) if told.quantity.name == "inertia xx")
    assert inertia.apart == ("flight2",)
    assert inertia.low[2] < inertia.value[2] < inertia.high[2]
    sentence = "inertia xx: flights differ; flight2 stands out"
    assert sentence in summary(differing)
    assert sentence.capitalize() in write_page(differing, [], tmp_path).read_text()


def test_a_flight_with_less_lift_than_the_others_is_named(folder, found):
    (thrust,) = (own for own in own_values(found) if own.quantity.name.startswith("thrust"))
    assert thrust.apart == ("flight2",)
    assert thrust.value[2] / np.delete(thrust.value, 2).mean() == pytest.approx(0.9, abs=0.01)
    assert thrust.text in summary(found)
    assert thrust.text.capitalize() in (folder / "identification.html").read_text()


def test_the_ends_of_the_prior_lie_at_one_and_minus_one(found):
    for quantity in found.quantities:
        ends = [place_in_prior(quantity, end) for end in quantity.prior]
        np.testing.assert_allclose(ends, [-1.0, 1.0], atol=1e-9)


def test_numbers_are_in_units_that_suit_the_vehicle(found):
    for name in ("inertia xx", "inertia zz", "inertia xy", "inertia of a rotor"):
        for times in (1.0, 1e4):  # one unit, from the smallest vehicle to the largest
            q = found[name]
            scaled = {key: times * getattr(q, key) for key in ("value", "low", "high")}
            assert interval(dc.replace(q, **scaled))[0].endswith(f"{NBSP}kg·cm²")
    assert interval(found["centre of mass x"])[0].endswith("mm")
    k = found["thrust coefficient"]
    assert interval(k)[0].endswith("× 10⁻⁸ N/(rad/s)²")
    assert half_width(k, k.value / 3, 3 * k.value) == "× ÷ 3"


def test_a_moment_about_z_that_no_body_has_is_lowered(found):
    flat = dc.replace(found)
    xx, yy = (found[f"inertia {axis}"].value for axis in ("xx", "yy"))
    flat.__dict__["quantities"] = tuple(
        dc.replace(q, value=1.1 * (xx + yy)) if q.name == "inertia zz" else q
        for q in found.quantities
    )
    vehicle = identified_vehicle(flat, "flat")
    assert vehicle.sources["inertia"].endswith("zz lowered to the largest that a body can have")
    assert 0.99 < vehicle.J[2, 2] / (xx + yy) <= 1.0
    np.testing.assert_allclose(
        np.diag(vehicle.J)[:2], [xx, yy], rtol=1e-5
    )  # six digits are written
