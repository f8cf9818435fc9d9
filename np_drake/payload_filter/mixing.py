"""Compiled weights of a bank of pendulums: interaction of its conditions, and what a label says of
its members.
"""

import math

import numpy as np

from np_drake.compiled import compiled
from np_drake.payload_filter.kernel import FIRST, PUSH, SIZE, difference, displace

RISE = PUSH + 2  # the slow force upwards, in a point; its error is `RISE_ERROR`
RISE_ERROR = 9


@compiled
def mix_bank(mean, covariance, weight, transition, rise, mixed, mixed_covariance, mixed_weight):
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
        mixed: (k, POINT) to be written.
        mixed_covariance: (k, SIZE, SIZE) as well.
        mixed_weight: (k,) as well.
    Source: Blom, Bar-Shalom 1988 (interacting multiple models); the changes balance as of
        Metropolis et al. 1953.
    """
    kinds = len(transition)
    lengths = len(mean) // kinds
    shift, errors, shares = np.zeros(SIZE), np.zeros((kinds, SIZE)), np.zeros(kinds)
    change = np.zeros((lengths, kinds, kinds))
    for length in range(lengths):
        for i in range(kinds):
            own = i * lengths + length
            _changes(
                mean[own, RISE],
                covariance[own, RISE_ERROR, RISE_ERROR],
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
            mixed_weight[here] = total
            shift[:] = 0.0
            for i in range(kinds):
                shares[i] = shares[i] / total if total > 0.0 else (1.0 if i == j else 0.0)
                difference(mean[here], mean[i * lengths + length], errors[i])
                for a in range(SIZE):
                    shift[a] += shares[i] * errors[i, a]
            for a in range(SIZE):
                for b in range(a + 1):
                    value = 0.0
                    for i in range(kinds):
                        apart = (errors[i, a] - shift[a]) * (errors[i, b] - shift[b])
                        value += shares[i] * (covariance[i * lengths + length, a, b] + apart)
                    mixed_covariance[here, a, b] = value
                    mixed_covariance[here, b, a] = value
            displace(mean[here], shift, mixed[here])


@compiled
def weigh_bank(weight, likelihood, mean, prior, deviation, first, stay, out):
    """Write the weights of the members after a label, of which a small share is drawn anew.

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
        out: (k,) to be written; they sum to one.
    """
    # Bayes: weight times likelihood, less the largest logarithm, so that nothing underflows
    score = np.log(weight) + likelihood
    largest, total, sum_out = score.max(), 0.0, 0.0
    for i in range(len(out)):
        out[i] = math.exp(score[i] - largest)
        total += out[i]
    for i in range(len(out)):
        apart = 0.0  # squared distance of the parameters from their prior, in deviations
        for k in range(prior.shape[1]):
            apart += ((mean[i, FIRST + k] - prior[i, k]) / deviation[i, k]) ** 2
        out[i] = stay * out[i] / total + (1.0 - stay) * first[i] * math.exp(-0.5 * apart)
        sum_out += out[i]
    for i in range(len(out)):
        out[i] /= sum_out


@compiled
def _changes(push, variance, transition, rise, i, out):
    """Write the probabilities (c,) of a change from condition i under a slow force upwards and its
    variance.
    """
    own, out[i] = rise[i] + variance, 1.0
    for j in range(len(rise)):
        if j != i:
            other = rise[j] + variance
            odds = 0.5 * (math.log(own / other) + push * push * (1.0 / own - 1.0 / other))
            out[j] = transition[j] * math.exp(min(odds, 0.0))
            out[i] -= out[j]
