/* Steps a component's engine on plain arrays, for any number of lanes, and exposes its generated
 * functions. Numbers are stored [.. ][element][lane]. */
#include "real.h"
#include "elementary.h"
#include "model.h"
#include "engine.h"

#define API __attribute__((visibility("default")))

static void load(const double *from, real *to, int n)
{
    for (int i = 0; i < n; i++)
        to[i] = r_load(from + (size_t)i * LANES);
}

static void store(const real *from, double *to, int n)
{
    for (int i = 0; i < n; i++)
        r_store(to + (size_t)i * LANES, from[i]);
}

API void sizes(int *out)
{
    out[0] = LANES, out[1] = N_P, out[2] = N_U, out[3] = N_X, out[4] = N_W, out[5] = N_Y;
}

/* Outputs, and states with them, before the first step and after each; u has one set of inputs per step. */
API int drive(int variant, const double *p, const double *u, int64_t interval_ns, int64_t step_ns,
              int steps, double *y, double *x)
{
    static struct block b;
    load(p, b.v, N_P);
    load(u, b.v + N_P, N_U);
    if (!engine_initial(&b, variant, 0))
        return 0;
    store(b.v + N_P + N_U, y, N_Y);
    store(engine_x(&b), x, N_X);
    for (int i = 0; i < steps; i++) {
        load(u + (size_t)i * N_U * LANES, b.v + N_P, N_U);
        if (!engine_step(&b, variant, 0, interval_ns, i * step_ns, (i + 1) * step_ns))
            return 0;
        store(b.v + N_P + N_U, y + (size_t)(i + 1) * N_Y * LANES, N_Y);
        store(engine_x(&b), x + (size_t)(i + 1) * N_X * LANES, N_X);
    }
    return 1;
}

#if LANES == 1
API void call_initial(int variant, const double *p, const double *w, double t, double *x)
{
    model_initial(variant, p, w, t, x);
}
API void call_tick(int variant, double *x, const double *u, const double *p, const double *w,
                   double t, double k)
{
    model_tick(variant, x, u, p, w, t, k);
}
API void call_output(int variant, double *x, const double *u, const double *p, double t)
{
    model_output(variant, x, u, p, t);
}
API void call_guard(int loop, int variant, const double *x, const double *u, const double *p,
                    double t, double *c)
{
    model_guard(loop, variant, x, u, p, t, c);
}
API void call_body(int loop, int variant, double *x, const double *u, const double *p,
                   const double *w, double t)
{
    model_body(loop, variant, m_true(1.0), x, u, p, w, t);
}
#ifdef HAS_EACH
API void call_row_guard(int loop, int variant, int row, double *x, const double *u,
                        const double *p, double t, double *c)
{
    model_row_guard(loop, variant, row, x, u, p, t, c);
}
API void call_row_body(int loop, int variant, int row, double *x, const double *u,
                       const double *p, double t)
{
    model_row_body(loop, variant, row, m_true(1.0), x, u, p, t);
}
#endif
#endif
