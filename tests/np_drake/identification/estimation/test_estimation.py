import dataclasses as dc

import numpy as np
import pytest

from np_drake.identification.estimation import Layout, Parameter, estimate

WIDE = Parameter("slope", 0.0, 10.0)
OFFSET = Parameter("offset", 0.0, 10.0, flight=True)


@dc.dataclass
class Line:
    """Stand-in for the model of a flight: one channel that is a line through its input."""

    x: np.ndarray
    y: np.ndarray
    step: float = 0.01

    @property
    def flight(self):
        return self

    @property
    def good(self):
        return np.ones(len(self.x), bool)

    def smooth(self, v) -> None:
        """Do nothing: a line has no smoothed input."""

    def residual(self, v) -> np.ndarray:
        """Return what the line leaves (m, 1)."""
        return (self.y - v["slope"] * self.x - v["offset"])[:, None]


def line(
    seed: int, slope: float = 2.0, *, noise: float = 0.5, rows: int = 3000, pole: float = 0.0
) -> Line:
    rng = np.random.default_rng(seed)
    x, e = rng.normal(size=rows), rng.normal(size=rows)
    for k in range(1, rows):
        e[k] += pole * e[k - 1]
    return Line(x, slope * x + 0.3 + noise * e)


def told(*lines: Line):
    """Return estimate, slope and its standard deviation."""
    layout = Layout.of([WIDE, OFFSET], set(), len(lines))
    dut = estimate(lines, layout)
    first = np.eye(layout.size)[0]
    return dut, WIDE.sd * dut.z[0], WIDE.sd * np.sqrt(dut.variance(first))


def test_a_line_with_white_noise_is_ordinary_least_squares():
    given = line(0)
    _, slope, sd = told(given)
    A = np.stack([given.x, np.ones_like(given.x)], axis=1)
    (best, _), *_ = np.linalg.lstsq(A, given.y)
    assert slope == pytest.approx(best, abs=0.5 * sd)
    assert sd == pytest.approx(0.5 / np.sqrt(3000), rel=0.2)


@pytest.mark.parametrize("pole", [0.0, 0.95])
def test_intervals_hold_the_truth_as_often_as_they_say(pole):
    errors = []
    for seed in range(60):
        _, slope, sd = told(line(seed, rows=1500, pole=pole))
        errors.append((slope - 2.0) / sd)
    assert np.mean(np.abs(errors) < 1.96) > 0.87  # 95 % within three deviations of 60 draws
    assert 0.6 < np.std(errors) < 1.35


def test_outliers_hardly_move_the_estimate():
    clean, broken = line(1), line(1)
    broken.y[::100] += 200.0
    _, here, _ = told(clean)
    _, there, _ = told(broken)
    assert abs(here - there) < 0.03  # plain least squares moves by 0.4


def test_flights_that_differ_are_each_told_and_widen_the_mean():
    slopes = [1.8, 2.0, 2.2, 2.4]
    dut, slope, sd = told(*[line(seed, s, noise=0.1) for seed, s in enumerate(slopes)])
    agreement = dut.agreement["slope"]
    np.testing.assert_allclose(WIDE.sd * agreement.values, slopes, atol=0.02)
    assert agreement.p < 1e-6
    assert WIDE.sd * np.sqrt(agreement.variance) == pytest.approx(np.std(slopes, ddof=1), rel=0.2)
    few = 3.182 / 1.96  # Student's t of three degrees of freedom over that of many
    assert sd == pytest.approx(few * np.std(slopes, ddof=1) / 2.0, rel=0.2)
    assert slope == pytest.approx(2.1, abs=0.1)


def test_offsets_of_flights_are_their_own():
    one, two = line(0), line(1)
    two.y += 3.0
    dut, _, _ = told(one, two)
    offsets = OFFSET.sd * dut.z[1:]
    assert offsets == pytest.approx([0.3, 3.3], abs=0.05)
    assert dut.agreement["slope"].p > 0.01


def test_no_deviation_exceeds_that_of_the_prior():
    dut, _, _ = told(line(0, -15.0, noise=0.01), line(1, 15.0, noise=0.01))
    assert max(map(dut.variance, np.eye(len(dut.z)))) <= 1.0 + 1e-9
