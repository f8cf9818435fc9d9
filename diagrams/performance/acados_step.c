// One real-time iteration of acados on the data of one problem: set, prepare, feed back, get.
#include <string.h>
#include <time.h>

#include "acados_c/ocp_nlp_interface.h"
#include "acados_solver_np_drake_peer.h"

#define PEER(name) np_drake_peer_acados_##name

static double now(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return t.tv_sec + 1e-9 * t.tv_nsec;
}

// x (N+1, nx), u (N, 4): the point of linearisation.   y_ref (N, ny), y_end (13): references.   W_end (13, 13).
// stage (np), of which the last 6 of `used` are replaced by offset (N, 6); end (np): parameters.
void np_drake_set(np_drake_peer_solver_capsule *capsule, const double *x, const double *u, const double *y_ref,
                  const double *y_end, const double *W_end, double *stage, int used, const double *offset,
                  const double *end, double *seconds)
{
    double start = now();
    ocp_nlp_config *config = PEER(get_nlp_config)(capsule);
    ocp_nlp_dims *dims = PEER(get_nlp_dims)(capsule);
    ocp_nlp_in *in = PEER(get_nlp_in)(capsule);
    ocp_nlp_out *out = PEER(get_nlp_out)(capsule);
    const int N = NP_DRAKE_PEER_N, nx = NP_DRAKE_PEER_NX, nu = NP_DRAKE_PEER_NU, ny = NP_DRAKE_PEER_NY;
    double zeros[16] = {0};
    for (int i = 0; i < N; i++)
    {
        memcpy(stage + used - 6, offset + 6 * i, 6 * sizeof(double));
        PEER(update_params)(capsule, i, stage, NP_DRAKE_PEER_NP);
        ocp_nlp_cost_model_set(config, dims, in, i, "yref", (void *) (y_ref + ny * i));
        ocp_nlp_out_set(config, dims, out, i, "u", (void *) (u + nu * i));
    }
    for (int i = 0; i <= N; i++)
    {
        ocp_nlp_out_set(config, dims, out, i, "x", (void *) (x + nx * i));
        ocp_nlp_out_set(config, dims, out, i, "sl", zeros);
        ocp_nlp_out_set(config, dims, out, i, "su", zeros);
    }
    PEER(update_params)(capsule, N, (double *) end, NP_DRAKE_PEER_NP);
    ocp_nlp_cost_model_set(config, dims, in, N, "yref", (void *) y_end);
    ocp_nlp_cost_model_set(config, dims, in, N, "W", (void *) W_end);
    seconds[0] = now() - start;
}

// x0 (nx): the measured state.   u (N, 4): the new plan.   seconds: of preparation and of feedback, added up.
// Returns acados' status of the feedback.
int np_drake_step(np_drake_peer_solver_capsule *capsule, const double *x0, double *u, double *seconds)
{
    ocp_nlp_config *config = PEER(get_nlp_config)(capsule);
    ocp_nlp_dims *dims = PEER(get_nlp_dims)(capsule);
    ocp_nlp_in *in = PEER(get_nlp_in)(capsule);
    ocp_nlp_out *out = PEER(get_nlp_out)(capsule);
    void *opts = PEER(get_nlp_opts)(capsule);
    int phase = 1;
    double start = now();
    ocp_nlp_solver_opts_set(config, opts, "rti_phase", &phase);
    PEER(solve)(capsule);
    double middle = now();
    phase = 2;
    ocp_nlp_constraints_model_set(config, dims, in, 0, "lbx", (void *) x0);
    ocp_nlp_constraints_model_set(config, dims, in, 0, "ubx", (void *) x0);
    ocp_nlp_solver_opts_set(config, opts, "rti_phase", &phase);
    int status = PEER(solve)(capsule);
    for (int i = 0; i < NP_DRAKE_PEER_N; i++)
        ocp_nlp_out_get(config, dims, out, i, "u", u + NP_DRAKE_PEER_NU * i);
    seconds[1] += middle - start;
    seconds[2] += now() - middle;
    return status;
}

// Lower bound of the tilt row (1) of the first stage, whose state is measured.
void np_drake_free_first_row(np_drake_peer_solver_capsule *capsule)
{
    double free = -100.0;
    ocp_nlp_constraints_model_set(PEER(get_nlp_config)(capsule), PEER(get_nlp_dims)(capsule),
                                  PEER(get_nlp_in)(capsule), 0, "lh", &free);
}
