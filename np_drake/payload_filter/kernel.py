"""Compiled filter step of a bank of pendulums: predict, then take in a measured force.

All quantities are per mass of the vehicle, so that force is [m/s²], drag is [1/s] and mass is a
share [1]. A pendulum is a point of `POINT` numbers; its error, to which the covariance belongs, has
`SIZE`:

| point | error | meaning |
|---|---|---|
| `TETHER`, `ACROSS` | 0, 1 | unit vector along the tether, and one across it, in W; the error turns it [rad] |
| `RATE` | 2, 3 | rate of the tether along `ACROSS` and tether x `ACROSS` [rad/s] |
| `MASS` | 4 | of the payload, as a share of the vehicle's [1] |
| `LOG_LENGTH` | 5 | logarithm of the length in metres [1] |
| `DAMPING` | 6 | drag of the payload over its mass [1/s] |
| `PUSH` | 7-9 | slow external force on the vehicle, in W [m/s²] |
| `THRUST_ERROR` | 10 | actual over commanded thrust, less one [1] |
| `DRAG` | 11 | drag of the vehicle [1/s] |

The tether is taut. The vehicle is accelerated by its thrust, its drag, the slow force and the pull,
so that the pull that both feel follows from the command and needs no measured acceleration, whose
noise would be in regressor and measurement alike. Moments are propagated by second-order divided
differences.
Source: Nørgaard, Poulsen, Ravn 2000 (filter DD2).
"""  # noqa: E501

import math
from typing import NamedTuple

import numpy as np

from np_drake.compiled import compiled

POINT = 16  # numbers of a point
SIZE = 12  # numbers of its error
FIRST = 8  # first number of a point that is a parameter
TETHER = slice(0, 3)
ACROSS = slice(3, 6)
RATE = slice(6, 8)
PARAMETERS = slice(8, 16)
MASS = 8
LOG_LENGTH = 9
DAMPING = 10
PUSH = 11
THRUST_ERROR = 14
DRAG = 15
SPREAD = 3.0  # squared interval of the differences: the kurtosis of a normal distribution [1]
LEAST_MASS = -0.5  # of a share that the differences try [1]
TINY = 1e-12  # least pivot of a covariance [units of the error, squared]


class Dynamics(NamedTuple):
    """How k pendulums change in a step, besides by their swing."""

    step: float  # [s]
    prior: np.ndarray  # (k, 8) to which the parameters return
    keep: np.ndarray  # (k, 8) share that they keep in a step [1]
    noise: np.ndarray  # (k, SIZE) variance added in a step


class Label(NamedTuple):
    """A measured force."""

    force: np.ndarray  # (3,) [m/s²]
    variance: np.ndarray  # (3,) of its noise [m²/s⁴]


@compiled
def filter_bank(mean, covariance, drive, now, dynamics, label):
    """Predict k pendulums over a step and take in one label.

    Args:
        mean: (k, POINT).
        covariance: (k, SIZE, SIZE).
        drive: (9,) mean over the last step, in W: lift along body z, velocity of the hook, and its
            acceleration by turning [m/s², m/s, m/s²].
        now: (9,) the same at its end.
        dynamics: `Dynamics` of the k pendulums.
        label: `Label`.
    Returns: points (k, POINT) and covariances (k, SIZE, SIZE) before the label, and with it; the
        logarithm of its likelihood (k,), and its squared normalised innovation (k,) [1].
    """
    predicted = np.empty_like(mean)
    spread = np.empty_like(covariance)
    updated = np.empty_like(mean)
    narrowed = np.empty_like(covariance)
    likelihood = np.empty(len(mean))
    distance = np.empty(len(mean))
    for i in range(len(mean)):
        _predict(mean[i], covariance[i], drive, dynamics, i, predicted[i], spread[i])
        likelihood[i], distance[i] = _update(
            predicted[i], spread[i], now, label, updated[i], narrowed[i]
        )
    return predicted, spread, updated, narrowed, likelihood, distance


@compiled
def pull_moments(mean, weight, now):
    """Return mean (3,) and covariance (3, 3) over the members of the pull on the vehicle, in W
    [m/s², m²/s⁴].

    Args:
        mean: (k, POINT) of the members.
        weight: (k,) of each [1].
        now: (9,) as of `filter_bank`.
    """
    centre = np.zeros(3)
    covariance = np.zeros((3, 3))
    pulls = np.empty((len(mean), 3))
    for i in range(len(mean)):
        _pull(mean[i], now, pulls[i])
    for i in range(len(mean)):
        centre += weight[i] * pulls[i]
    for i in range(len(mean)):
        apart = pulls[i] - centre
        covariance += np.outer(weight[i] * apart, apart)
    return centre, covariance


@compiled
def _predict(mean, covariance, drive, dynamics, i, out, out_covariance):
    prior = dynamics.prior[i]
    keep = dynamics.keep[i]
    root = np.zeros((SIZE, SIZE))
    _cholesky(covariance, root)
    out[:] = mean
    _advance(out, drive, dynamics.step, prior, keep)
    plus = np.zeros((SIZE, SIZE))
    minus = np.zeros((SIZE, SIZE))
    point = np.zeros(POINT)
    error = np.zeros(SIZE)
    width = math.sqrt(SPREAD)
    for j in range(SIZE):
        for sign in (1.0, -1.0):
            for k in range(SIZE):
                error[k] = sign * width * root[k, j]
            displace(mean, error, point)
            _advance(point, drive, dynamics.step, prior, keep)
            difference(out, point, plus[j] if sign > 0 else minus[j])
    _moments(plus, minus, error, out_covariance)
    for k in range(SIZE):
        out_covariance[k, k] += dynamics.noise[i, k]
    displace(out, error, point)
    out[:] = point


@compiled
def _update(mean, covariance, now, label, out, out_covariance):
    root = np.zeros((SIZE, SIZE))
    _cholesky(covariance, root)
    centre = np.zeros(3)
    _measure(mean, now, centre)
    plus = np.zeros((SIZE, 3))
    minus = np.zeros((SIZE, 3))
    _label_differences(mean, root, now, centre, plus, minus)
    innovation = np.zeros(3)
    spread = np.zeros((3, 3))
    _moments(plus, minus, innovation, spread)
    for k in range(3):
        spread[k, k] += label.variance[k]
        innovation[k] = label.force[k] - centre[k] - innovation[k]
    inverse, determinant = inverted(spread)
    distance = 0.0
    for k in range(3):  # loops, as a call of BLAS costs more than products this small
        for a in range(3):
            distance += innovation[k] * inverse[k, a] * innovation[a]
    error = np.zeros(SIZE)
    _correct(covariance, _cross(root, plus, minus), inverse, innovation, error, out_covariance)
    _keep_mass_positive(mean, error, out_covariance)
    displace(mean, error, out)
    out[DAMPING] = max(out[DAMPING], 0.0)
    return -0.5 * (distance + math.log(determinant)), distance


@compiled
def _label_differences(mean, root, now, centre, plus, minus):
    """Write the differences (SIZE, 3) of the label from that of the mean, along the columns of the
    root.
    """
    point = np.zeros(POINT)
    force = np.zeros(3)
    error = np.zeros(SIZE)
    width = math.sqrt(SPREAD)
    for j in range(SIZE):
        for sign in (1.0, -1.0):
            for k in range(SIZE):
                error[k] = sign * width * root[k, j]
            displace(mean, error, point)
            _measure(point, now, force)
            side = plus if sign > 0 else minus
            for k in range(3):
                side[j, k] = force[k] - centre[k]


@compiled
def _cross(root, plus, minus):
    """Return the covariance (SIZE, 3) of point and label, by divided differences along the root."""
    cross = np.zeros((SIZE, 3))
    for j in range(SIZE):
        for k in range(3):
            slope = (plus[j, k] - minus[j, k]) / (2.0 * math.sqrt(SPREAD))
            for row in range(j, SIZE):
                cross[row, k] += root[row, j] * slope
    return cross


@compiled
def _correct(covariance, cross, inverse, innovation, error, out_covariance):
    """Write the correction (SIZE,) by an innovation (3,), and the covariance after it.

    Kalman update: K = P_xy S^-1, x + K (y - y_hat), P - K P_xy'.
    """
    gain = np.zeros(3)
    for row in range(SIZE):
        gain[:] = 0.0
        for k in range(3):
            for a in range(3):
                gain[k] += cross[row, a] * inverse[a, k]
            error[row] += gain[k] * innovation[k]
        for column in range(row + 1):
            kept = covariance[row, column]
            for k in range(3):
                kept -= gain[k] * cross[column, k]
            out_covariance[row, column] = out_covariance[column, row] = kept


@compiled
def inverted(A):
    """Return the inverse of a matrix (3, 3) and its determinant; entries that are no numbers raise
    nothing.
    """
    out = np.empty((3, 3))
    for i in range(3):
        for j in range(3):
            a = (i + 1) % 3
            b = (i + 2) % 3
            c = (j + 1) % 3
            d = (j + 2) % 3
            out[j, i] = A[a, c] * A[b, d] - A[a, d] * A[b, c]
    determinant = A[0, 0] * out[0, 0] + A[0, 1] * out[1, 0] + A[0, 2] * out[2, 0]
    return out / determinant, determinant


@compiled
def _keep_mass_positive(mean, error, covariance):
    """Move an error that makes the mass negative to the likeliest one that makes it zero.

    A negative mass on a swing of opposite phase pulls to the side as a payload does. The
    differences may try one: a bound inside them would bias a mass of zero upwards.
    Source: Simon 2010 (Kalman filter with state constraints).
    """
    index = MASS - POINT + SIZE
    short = mean[MASS] + error[index]
    if short < 0.0:
        scale = short / max(covariance[index, index], TINY)
        error -= covariance[:, index] * scale


@compiled
def _moments(plus, minus, mean, covariance):
    """Write the mean (s,) and the covariance (s, s) of values whose differences from the centre are
    (SIZE, s) each.
    """
    # DD2: cov = (plus - minus)(plus - minus)' / 4h² + (h² - 1)(plus + minus)(plus + minus)' / 4h⁴
    # with h² = `SPREAD`
    first = math.sqrt(1.0 / (4.0 * SPREAD))
    second = math.sqrt((SPREAD - 1.0) / (4.0 * SPREAD**2))
    size = plus.shape[1]
    odd = np.empty(size)
    even = np.empty(size)
    mean[:] = 0.0
    covariance[:] = 0.0
    for j in range(SIZE):
        for a in range(size):
            mean[a] += (plus[j, a] + minus[j, a]) / (2.0 * SPREAD)
            odd[a] = first * (plus[j, a] - minus[j, a])
            even[a] = second * (plus[j, a] + minus[j, a])
        for a in range(size):
            for b in range(a + 1):
                covariance[a, b] += odd[a] * odd[b] + even[a] * even[b]
    for a in range(size):
        for b in range(a):
            covariance[b, a] = covariance[a, b]


@compiled
def _cholesky(A, out):
    """Write the lower root of a covariance; a pivot that round-off made negative counts as
    `TINY`.
    """
    for j in range(SIZE):
        for i in range(j, SIZE):
            total = A[i, j]
            for k in range(j):
                total -= out[i, k] * out[j, k]
            if i == j:
                out[j, j] = math.sqrt(max(total, TINY))
            else:
                out[i, j] = total / out[j, j]


@compiled
def displace(point, error, out):
    """Write a point with an error added: the tether turns along a great circle, all else adds.

    Args:
        point: (POINT,).
        error: (SIZE,).
        out: (POINT,).
    """
    n = point[0:3]
    e = point[3:6]
    f0, f1, f2 = _third_axis(point)
    a = error[0]
    b = error[1]
    angle = math.sqrt(a * a + b * b)
    near = math.cos(angle)
    along = math.sin(angle) / angle if angle > 1e-9 else 1.0
    out[0] = near * n[0] + along * (a * e[0] + b * f0)
    out[1] = near * n[1] + along * (a * e[1] + b * f1)
    out[2] = near * n[2] + along * (a * e[2] + b * f2)
    _across(out, e)
    for k in range(6, POINT):
        out[k] = point[k] + error[k - 4]


@compiled
def _across(out, e):
    """Write the vector across the tether of `out` that is nearest to e (3,); both become unit
    vectors.
    """
    size = math.sqrt(out[0] ** 2 + out[1] ** 2 + out[2] ** 2)
    for k in range(3):
        out[k] /= size
    along = out[0] * e[0] + out[1] * e[1] + out[2] * e[2]
    a = e[0] - along * out[0]
    b = e[1] - along * out[1]
    c = e[2] - along * out[2]
    size = math.sqrt(a * a + b * b + c * c)
    out[3] = a / size
    out[4] = b / size
    out[5] = c / size


@compiled
def difference(origin, point, out):
    """Write the error that leads from one point to another; rates are projected onto the plane
    across the first.

    Args:
        origin: (POINT,).
        point: (POINT,).
        out: (SIZE,).
    """
    n = origin[0:3]
    e = origin[3:6]
    f0, f1, f2 = _third_axis(origin)
    x = point[0] * e[0] + point[1] * e[1] + point[2] * e[2]
    y = point[0] * f0 + point[1] * f1 + point[2] * f2
    z = point[0] * n[0] + point[1] * n[1] + point[2] * n[2]
    side = math.sqrt(x * x + y * y)
    factor = math.atan2(side, z) / side if side > 1e-9 else 1.0
    out[0] = factor * x
    out[1] = factor * y
    w0, w1, w2 = tether_rate(point)
    out[2] = w0 * e[0] + w1 * e[1] + w2 * e[2] - origin[6]
    out[3] = w0 * f0 + w1 * f1 + w2 * f2 - origin[7]
    for k in range(4, SIZE):
        out[k] = point[k + 4] - origin[k + 4]


@compiled
def _third_axis(p):
    """Return tether x across of a point."""
    return p[1] * p[5] - p[2] * p[4], p[2] * p[3] - p[0] * p[5], p[0] * p[4] - p[1] * p[3]


@compiled
def tether_rate(p):
    """Return the rate of the tether in W [rad/s]."""
    a = p[6]
    b = p[7]
    f0, f1, f2 = _third_axis(p)
    return a * p[3] + b * f0, a * p[4] + b * f1, a * p[5] + b * f2


@compiled
def _felt(p, d, k):
    """Return component k of the acceleration less gravity of a vehicle that nothing pulls
    [m/s²].
    """
    return (1.0 + p[THRUST_ERROR]) * d[k] + p[PUSH + k] - p[DRAG] * d[3 + k] + d[6 + k]


@compiled
def _advance(p, drive, step, prior, keep):
    """Move a point by one step in place: a symplectic step on the sphere, parameters towards their
    prior.
    """
    length = math.exp(p[LOG_LENGTH])
    damping = max(p[DAMPING], 0.0)
    push = (
        _felt(p, drive, 0) + damping * drive[3],
        _felt(p, drive, 1) + damping * drive[4],
        _felt(p, drive, 2) + damping * drive[5],
    )
    w0, w1, w2 = _kick(p, tether_rate(p), push, length, damping, 0.5 * step)
    speed = math.sqrt(w0 * w0 + w1 * w1 + w2 * w2)
    near = math.cos(speed * step)
    sine = math.sin(speed * step)
    along = sine / speed if speed > 1e-9 else step
    n0 = p[0]
    n1 = p[1]
    n2 = p[2]
    p[0] = near * n0 + along * w0
    p[1] = near * n1 + along * w1
    p[2] = near * n2 + along * w2
    turned = (
        near * w0 - speed * sine * n0,
        near * w1 - speed * sine * n1,
        near * w2 - speed * sine * n2,
    )
    w0, w1, w2 = _kick(p, turned, push, length, damping, 0.5 * step)
    _across(p, p[3:6])
    p[6] = w0 * p[3] + w1 * p[4] + w2 * p[5]
    f0, f1, f2 = _third_axis(p)
    p[7] = w0 * f0 + w1 * f1 + w2 * f2
    for k in range(len(prior)):
        p[FIRST + k] = prior[k] + keep[k] * (p[FIRST + k] - prior[k])


@compiled
def _kick(p, rate, push, length, damping, span):
    """Return the rate of the tether after its acceleration by `push` acted for `span` [s]."""
    along = push[0] * p[0] + push[1] * p[1] + push[2] * p[2]
    # implicit, so that no damping is unstable
    kept = 1.0 / (1.0 + span * damping)
    pushed = span / length
    return (
        kept * (rate[0] - pushed * (push[0] - along * p[0])),
        kept * (rate[1] - pushed * (push[1] - along * p[1])),
        kept * (rate[2] - pushed * (push[2] - along * p[2])),
    )


@compiled
def _pull(p, now, out):
    """Write the pull on the vehicle (3,) [m/s²]; none where the tether would have to push."""
    length = math.exp(p[LOG_LENGTH])
    damping = max(p[DAMPING], 0.0)
    mass = max(p[MASS], LEAST_MASS)
    along = 0.0
    for k in range(3):
        along += p[k] * (_felt(p, now, k) + damping * now[3 + k])
    tension = max(0.0, length * (p[6] * p[6] + p[7] * p[7]) - along)
    for k in range(3):
        out[k] = mass / (1.0 + mass) * tension * p[k]


@compiled
def _measure(p, now, out):
    """Write the label (3,) that a point predicts [m/s²]."""
    _pull(p, now, out)
    for k in range(3):
        out[k] += p[THRUST_ERROR] * now[k] - p[DRAG] * now[3 + k] + p[PUSH + k]


RISE = PUSH + 2  # the slow force upwards, in a point; its error is `RISE_ERROR`
RISE_ERROR = 9


@compiled
def mix_bank(mean, covariance, weight, transition, rise):
    """Let the conditions of each length interact: what one of them found is where the others go on
    from.

    A steady wind is level: a slow force upwards that a condition does not know keeps a member from
    changing to it, so that such a force has under every condition the prior of that condition.

    Args:
        mean: (k, POINT), ordered by condition, then by length.
        covariance: (k, SIZE, SIZE).
        weight: (k,) [1].
        transition: (c, c) probability of a change from one condition to another in a step.
        rise: (c,) variance of the slow force upwards [m²/s⁴].
    Returns: mean, covariance and weight after it.
    Source: Blom, Bar-Shalom 1988 (interacting multiple models); the changes balance as of
        Metropolis et al. 1953.
    """
    mixed = np.empty_like(mean)
    spread = np.empty_like(covariance)
    share = np.empty_like(weight)
    kinds = len(transition)
    lengths = len(mean) // kinds
    shift = np.zeros(SIZE)
    errors = np.zeros((kinds, SIZE))
    shares = np.zeros(kinds)
    change = np.zeros((lengths, kinds, kinds))
    for length in range(lengths):
        for i in range(kinds):
            member = i * lengths + length
            _changes(
                mean[member, RISE],
                covariance[member, RISE_ERROR, RISE_ERROR],
                transition[i],
                rise,
                i,
                change[length, i],
            )
    for j in range(kinds):
        for length in range(lengths):
            here = j * lengths + length
            total = 0.0
            for i in range(kinds):
                shares[i] = change[length, i, j] * weight[i * lengths + length]
                total += shares[i]
            share[here] = total
            shift[:] = 0.0
            for i in range(kinds):
                shares[i] = shares[i] / total if total > 0.0 else (1.0 if i == j else 0.0)
                difference(mean[here], mean[i * lengths + length], errors[i])
                shift += shares[i] * errors[i]
            for a in range(SIZE):
                for b in range(a + 1):
                    value = 0.0
                    for i in range(kinds):
                        apart = (errors[i, a] - shift[a]) * (errors[i, b] - shift[b])
                        value += shares[i] * (covariance[i * lengths + length, a, b] + apart)
                    spread[here, a, b] = spread[here, b, a] = value
            displace(mean[here], shift, mixed[here])
    return mixed, spread, share


@compiled
def weigh_bank(weight, likelihood, mean, prior, deviation, first, stay):
    """Return the weights of the members after a label, of which a small share is drawn anew, (k,);
    they sum to one.

    A change leads to a member whose parameters were fitted all along, as if it had always been
    true: they must be such as could have been drawn.

    Args:
        weight: (k,) before it [1].
        likelihood: (k,) logarithm of that of the label.
        mean: (k, POINT) with the label.
        prior: (k, 8) mean of the parameters.
        deviation: (k, 8) of that prior.
        first: (k,) weight before any flight [1].
        stay: share that is not drawn anew [1].
    """
    # Bayes: weight times likelihood, less the largest logarithm, so that nothing underflows
    score = np.log(weight) + likelihood
    out = np.exp(score - score.max())
    out /= out.sum()
    for i in range(len(out)):
        # squared distance of the parameters from their prior, in deviations
        apart = (((mean[i, PARAMETERS] - prior[i]) / deviation[i]) ** 2).sum()
        out[i] = stay * out[i] + (1.0 - stay) * first[i] * math.exp(-0.5 * apart)
    return out / out.sum()


@compiled
def _changes(push, variance, transition, rise, i, out):
    """Write the probabilities (c,) of a change from condition i under a slow force upwards and its
    variance.
    """
    total = rise[i] + variance
    out[i] = 1.0
    for j in range(len(rise)):
        if j != i:
            other = rise[j] + variance
            odds = 0.5 * (math.log(total / other) + push * push * (1.0 / total - 1.0 / other))
            out[j] = transition[j] * math.exp(min(odds, 0.0))
            out[i] -= out[j]
