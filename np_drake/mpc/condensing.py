"""Compiled sensitivities of a single shooting, and what the quadratic model makes of them.

A loop over the columns reads at most eight rows: with more the compiler gives up its vector form.
"""

from np_drake.compiled import compiled


@compiled
def sensitivities(Fx, Fu, markov, own, S, chi):
    """Write dx_(i+1)/dT, S (N, 13, 4N); the columns of later inputs stay as they are.

    Args:
        Fx: (N, 13, 19) over [x, chi].
        Fu: (N, 13, 4) over the rotor thrusts.
        markov: (6, 6(N-1)) of `Horizon`, or (6, 0).
        own: (N, 6, 6) of the reaction of the wrench, or (0, 6, 6).
        S: (N, 13, 4N) to be written.
        chi: (6, 4N) workspace.
    """
    known, reacts = markov.shape[1], len(own) > 0
    for i in range(len(Fx)):
        size = 4 * i
        for row in range(13):
            for col in range(4):
                S[i, row, size + col] = Fu[i, row, col]
        if i == 0:
            continue
        # S_(i+1) = Fx S_i + Fchi dchi_i/dT + Fu, where input i acts from stage i on
        _move(Fx[i], S[i - 1], S[i], size)
        driven = known > 0 and i > 1
        if driven or reacts:
            chi[:, :size] = 0.0
            if driven:
                _drive(markov, known - 6 * i, S, i, chi)
            if reacts:
                _six_rows(own[i], 0, S[i - 1], size, chi)
            _push(Fx[i], chi, S[i], size)


@compiled
def _move(F, before, after, size):
    """Write dF/dx times `before` (13, …) to `after`."""
    for row in range(13):
        w, i, j, k, a, b, c = (
            F[row, 3],
            F[row, 4],
            F[row, 5],
            F[row, 6],
            F[row, 10],
            F[row, 11],
            F[row, 12],
        )
        if row < 3:
            h = F[row, 7 + row]
            for col in range(size):
                after[row, col] = before[row, col] + h * before[7 + row, col]
        elif 7 <= row < 10:
            for col in range(size):
                after[row, col] = before[row, col]
        else:
            for col in range(size):
                after[row, col] = 0.0
        if row < 10:
            for col in range(size):
                after[row, col] += (
                    w * before[3, col]
                    + i * before[4, col]
                    + j * before[5, col]
                    + k * before[6, col]
                ) + (a * before[10, col] + b * before[11, col] + c * before[12, col])
        else:
            for col in range(size):
                after[row, col] += a * before[10, col] + b * before[11, col] + c * before[12, col]


@compiled
def _drive(markov, first, S, i, chi):
    """Add to chi (6, …) what the motion before stage i drives; zeta_0 is measured."""
    for j in range(1, i):
        _six_rows(markov, first + 6 * j, S[j - 1], 4 * j, chi)


@compiled
def _six_rows(M, at, S, size, out):
    """Add M[:, at:at+6] times dzeta/dT, rows 7 … 12 of S, to out (6, …)."""
    for row in range(6):
        a, b, c, d, e, f = (
            M[row, at],
            M[row, at + 1],
            M[row, at + 2],
            M[row, at + 3],
            M[row, at + 4],
            M[row, at + 5],
        )
        for col in range(size):
            out[row, col] += (
                a * S[7, col]
                + b * S[8, col]
                + c * S[9, col]
                + d * S[10, col]
                + e * S[11, col]
                + f * S[12, col]
            )


@compiled
def _push(F, chi, S, size):
    """Add dF/dchi times chi (6, …) to S (13, …)."""
    for row in range(13):
        a, b, c = F[row, 16], F[row, 17], F[row, 18]
        if row < 3 or 7 <= row < 10:
            axis = row if row < 3 else row - 7
            h = F[row, 13 + axis]
            for col in range(size):
                S[row, col] += (
                    h * chi[axis, col] + a * chi[3, col] + b * chi[4, col] + c * chi[5, col]
                )
        else:
            for col in range(size):
                S[row, col] += a * chi[3, col] + b * chi[4, col] + c * chi[5, col]


@compiled
def weigh(S, root, first, out):
    """Write root (13,) times the sensitivities S (N, 13, 4N) of m stages from `first` on.

    Args:
        S: (N, 13, 4N).
        root: (13,) roots of the weights.
        out: (13 m, 4 (first + m)); later inputs do not act on these stages.
    """
    size = out.shape[1]
    for i in range(len(out) // 13):
        for row in range(13):
            for col in range(size):
                out[13 * i + row, col] = root[row] * S[first + i, row, col]


@compiled
def weigh_end(S, root, out):
    """Write the weighted last sensitivities to the last rows of `out`.

    Args:
        S: (N, 13, 4N).
        root: (13, 13), F with F'F = P.
        out: (…, 4N).
    """
    last, first = S[len(S) - 1], len(out) - 13
    for row in range(13):
        for col in range(out.shape[1]):
            out[first + row, col] = 0.0
        for s in range(13):
            k = root[row, s]
            if k != 0.0:
                for col in range(out.shape[1]):
                    out[first + row, col] += k * last[s, col]


@compiled
def gradient(x, x_ref, u, u_ref, Q, R, P, mixer, S, out):
    """Write the gradient of the tracking cost over the rotor thrusts to out (4N,) [1/N].

    Args:
        x: (N+1, 13) states.
        x_ref: (N+1, 13) wanted.
        u: (N, 4) inputs [N, N·m].
        u_ref: (N, 4) wanted.
        Q: (13,) weights of the states.
        R: (4,) of the inputs.
        P: (13, 13) of the last state.
        mixer: (4, 4) rotor thrusts to inputs.
        S: (N, 13, 4N) sensitivities.
        out: (4N,) to be written.
    """
    n = len(u)
    for i in range(n):
        for col in range(4):
            total = 0.0
            for row in range(4):
                total += R[row] * (u[i, row] - u_ref[i, row]) * mixer[row, col]
            out[4 * i + col] = 2 * total
    for i in range(n):
        for row in range(13):
            if i < n - 1:
                pull = Q[row] * (x[i + 1, row] - x_ref[i + 1, row])
            else:
                pull = 0.0
                for s in range(13):
                    pull += P[row, s] * (x[n, s] - x_ref[n, s])
            for col in range(4 * i + 4):
                out[col] += 2 * pull * S[i, row, col]
