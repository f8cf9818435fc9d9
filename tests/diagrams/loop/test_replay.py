"""Laws of the replay page of a flight, read from the page as a browser reads it."""

import dataclasses as dc
import re

import numpy as np
import pytest

from diagrams.loop import flight_figures
from diagrams.loop.replay import FRAME_RATE, POLICY, frames, position_error, write_replay
from np_drake import attitude
from np_drake.files.figure_file import DASHES

POSITION = 1e-12  # of what is copied, in double precision [m]


@pytest.fixture(scope="module")
def flight(flown):
    return flown("circle", "hold")


@pytest.fixture(scope="module")
def page(flight, replay_page, tmp_path_factory):
    path = tmp_path_factory.mktemp("page") / "replay.html"
    write_replay(flight, path)
    return replay_page(path)


def shown(flight, name):
    return flight.signals[name][frames(flight.signals["t"])]


def ends(film, lower):
    """Lower or upper end of the tether in every frame, (frames, 3) [m]."""
    bar, half = film["tether"], 0.5 * film["tether"]["scale"][:, 2]
    q = bar["quaternion"][:, [3, 0, 1, 2]]  # three.js: x, y, z, w
    return bar["position"] + (1 if lower else -1) * half[:, None] * attitude.body_z(q)


def test_the_payload_hangs_on_the_tethers_end_in_every_frame(flight, page):
    x, hook = shown(flight, "x_true"), np.array(flight.config.reality.hung.hook)
    np.testing.assert_allclose(ends(page.film, True), page.film["payload"]["position"], atol=1e-9)
    at_hook = x[:, :3] + attitude.rotate(x[:, 3:7], np.tile(hook, (len(x), 1)))
    np.testing.assert_allclose(ends(page.film, False), at_hook, atol=1e-5)  # norm of q [m]
    assert np.all(page.film["payload"]["visible"])


def test_the_vehicle_is_where_it_flew_and_so_are_its_arrows(flight, page):
    x = shown(flight, "x_true")
    for name in ("quadrotor", "thrust", "force"):
        np.testing.assert_allclose(page.film[name]["position"], x[:, :3], atol=POSITION)
    thrust = attitude.body_z(page.film["thrust"]["quaternion"][:, [3, 0, 1, 2]])
    np.testing.assert_allclose(thrust, attitude.body_z(x[:, 3:7]), atol=1e-5)  # norm of q
    total = shown(flight, "rotor_thrust").sum(axis=1)
    length = page.film["thrust"]["scale"][:, 2]
    np.testing.assert_allclose(length / length[0], total / total[0], rtol=1e-5)


def test_the_read_out_is_the_error_of_the_flight(flight, page):
    (error,) = page.numbers["errors"]
    expected = 100 * position_error(flight)[frames(flight.signals["t"])]  # [cm]
    np.testing.assert_allclose(error["cm"], expected, atol=0.00501)  # two digits


def test_a_payload_that_is_hung_in_flight_is_hidden_until_then(
    flight, replay_page, tmp_path, monkeypatch
):
    monkeypatch.setattr(type(flight.config.reality), "hangs_at", 0.4)
    write_replay(flight, tmp_path / "late.html")
    visible = replay_page(tmp_path / "late.html").film["payload"]["visible"]
    np.testing.assert_array_equal(visible, np.arange(len(visible)) / FRAME_RATE >= 0.4 - 1e-9)


def test_a_flight_without_a_payload_shows_none(flight, replay_page, tmp_path):
    bare = {**flight.signals, "plant_state": flight.signals["plant_state"][:, :13]}
    write_replay(dc.replace(flight, signals=bare), tmp_path / "bare.html")
    assert not {"payload", "tether"} & replay_page(tmp_path / "bare.html").objects


def test_a_narrow_window_follows_the_vehicle_and_holds_its_payload(flight, page):
    dut = page.numbers
    assert dut["wide"]  # a wide one shows all of the flight
    assert dut["follow"]["path"] == ["drake", "quadrotor"]
    eye, fov = np.array(dut["follow"]["eye"]), np.deg2rad(75.0)  # Meshcat's camera
    assert np.linalg.norm(eye) * np.tan(fov / 2) > flight.config.reality.hung.length
    assert "Math.max(1, innerHeight / innerWidth)" in page.text


def test_the_ground_is_the_pages_light_or_dark(page):
    light, dark = page.text.split("@media (prefers-color-scheme: dark)")[-2:]
    assert "body { background: #eceff3; }" in light
    assert "body { background: #14171c; }" in dark
    assert page.properties["/Background/<object>", "use_ar_background"]  # no sky, whose edges show


def test_every_controller_has_a_line_of_its_own_and_numbers_can_be_read(flight, smallest_text):
    assert ":" not in DASHES  # the reference's
    assert len(set(DASHES[:6])) == 6
    assert smallest_text(flight_figures.overlay([flight] * 4)) >= 9.0  # [px]


def test_the_page_can_load_nothing_from_a_network(page):
    assert f'content="{POLICY}"' in page.text  # the browser itself refuses what is not named
    assert not re.search(r"https?:|\*|'self'", POLICY)
    assert page.text.index(POLICY) < page.text.index("<script")
    assert ".dg { display: none !important; }" in page.text  # Meshcat's own controls
    assert not re.search(r"<(script|link|img|iframe)[^>]*\b(src|href)=", page.text)
