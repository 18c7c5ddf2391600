/* The posterior Cramer-Rao recursion (P. Tichavsky, C. H. Muravchik, A. Nehorai, Posterior
 * Cramer-Rao bounds for discrete-time nonlinear filtering, IEEE Trans. Signal Process. 46, 1998,
 * 1386-1396), for LANES divers at once; compiled once per number of lanes. The recursion carries
 * P = 1/J, since a state that is known exactly has no J. Rows, transitions and priors are
 * generated from the receivers' equations. */
#include <stddef.h>

#include "bound.h"
#include "elementary.h"

#define PASTE_(a, b) a##b
#define PASTE(a, b) PASTE_(a, b)

enum counts { READINGS, PACKETS, BEACONS };
enum { PLACES = 3, OWN_BEACON = 2, PINGS = 4 }; /* the last two: from the end of the parameters */

/* A scalar measurement: its row, with the elements of the states in at, then its variance.
 * own_beacon: whether it exists only if packets hold their own beacon's position alone (1), only
 * if they do not (0), or always (-1). */
struct row {
    int counts, own_beacon, used;
    const int *at;
    void (*value)(const real *p, const real *surroundings, real *h);
};

/* States from states on belong to a beacon; each beacon has a copy. */
struct model {
    int states, each, parameters, n_phi, n_noise, n_rows;
    const int (*phi)[2], (*noise)[2]; /* Phi without its ones; the upper triangle of Q */
    const struct row *rows;
    void (*prior)(const real *p, const real *surroundings, real *variance);
    void (*transition)(const real *p, real dt, real *phi_and_noise);
    void (*marginals)(const real *p, const real *P, int n, real *absolute_and_relative);
};

#include "bound_model.h"

/* Number of beacons that a state belongs to, if any. */
static int copies(const struct model *m, int state, int beacons)
{
    return state < m->states ? 1 : beacons;
}

static void prior(const struct model *m, int beacons, int n, const real *p, const real *s, real *P)
{
    real variance[MOST_STATES];
    m->prior(p, s, variance);
    for (int i = 0; i < n * n; i++)
        P[i] = r_set1(0.0);
    for (int i = 0; i < m->states + m->each; i++)
        for (int b = 0; b < copies(m, i, beacons); b++)
            P[(i + b * m->each) * (n + 1)] = variance[i];
}

/* A row of P, of which only the upper triangle is kept. */
static void row_of(const real *P, int n, int i, real *row)
{
    for (int k = 0; k < i; k++)
        row[k] = P[k * n + i];
    for (int k = i; k < n; k++)
        row[k] = P[i * n + k];
}

static void put_row(real *P, int n, int i, const real *row)
{
    for (int k = 0; k < i; k++)
        P[k * n + i] = row[k];
    for (int k = i; k < n; k++)
        P[i * n + k] = row[k];
}

/* P with an element of Phi: state i becomes v times itself, or itself plus v times state j. */
static void move(real *P, int n, int i, int j, real v)
{
    real to[MOST_STATES], from[MOST_STATES];
    row_of(P, n, i, to);
    row_of(P, n, j, from);
    if (i == j) {
        for (int k = 0; k < n; k++)
            to[k] = to[k] * v;
        to[i] = to[i] * v;
    } else {
        const real crossed = to[j] + v * from[j];
        for (int k = 0; k < n; k++)
            to[k] = to[k] + v * from[k];
        to[i] = to[i] + v * crossed;
    }
    put_row(P, n, i, to);
}

/* P <- Phi P Phi' + Q. States are moved only by states that nothing moves, so the elements of Phi
 * can be applied one after another, those of the diagonal last. */
static void advance(const struct model *m, int beacons, int n, const real *p, real dt, real *P)
{
    real value[MOST_ELEMENTS];
    m->transition(p, dt, value);
    for (int itself = 0; itself < 2; itself++)
        for (int e = 0; e < m->n_phi; e++) {
            const int i = m->phi[e][0], j = m->phi[e][1];
            for (int b = 0; (i == j) == itself && b < copies(m, i, beacons); b++)
                move(P, n, i + b * m->each, j + b * m->each, value[e]);
        }
    for (int e = 0; e < m->n_noise; e++) {
        const int i = m->noise[e][0], j = m->noise[e][1];
        for (int b = 0; b < copies(m, i, beacons); b++)
            P[(i + b * m->each) * n + j + b * m->each] += value[m->n_phi + e];
    }
}

/* P with a scalar measurement, in Joseph's form (I - k h) P (I - k h)' + k R k', so that it stays
 * a covariance whatever R is. */
static void measure(int n, int used, const int *at, const real *h, real R, real *P)
{
    real rows[MOST_USED][MOST_STATES], c[MOST_STATES], k[MOST_STATES], d[MOST_STATES], s = R;
    for (int u = 0; u < used; u++)
        row_of(P, n, at[u], rows[u]);
    for (int i = 0; i < n; i++) {
        c[i] = rows[0][i] * h[0];
        for (int u = 1; u < used; u++)
            c[i] = c[i] + rows[u][i] * h[u];
    }
    for (int u = 0; u < used; u++)
        s = s + h[u] * c[at[u]];
    s = r_set1(1.0) / s;
    for (int i = 0; i < n; i++) {
        k[i] = c[i] * s;
        d[i] = R * k[i];
    }
    for (int u = 0; u < used; u++)
        for (int i = 0; i < n; i++) {
            const int above = i < at[u] ? i : at[u], below = i < at[u] ? at[u] : i;
            d[i] = d[i] - (rows[u][i] - c[above] * k[below]) * h[u];
        }
    for (int i = 0; i < n; i++)
        for (int j = i; j < n; j++)
            P[i * n + j] = (P[i * n + j] - c[i] * k[j]) + d[i] * k[j];
}

/* One kind of measurement, of one beacon or of none; there: number of such measurements. */
static void take(const struct model *m, int n, const struct row *row, int beacon, double there,
                 real told, const real *p, const real *s, real *P)
{
    const double own = r_get(p[m->parameters - OWN_BEACON], 0);
    real h[MOST_USED];
    int at[MOST_USED];
    if (!(there > 0.0) || (row->own_beacon >= 0 && row->own_beacon != (own != 0.0)))
        return;
    row->value(p, s, h);
    for (int u = 0; u < row->used; u++)
        at[u] = row->at[u] + (row->at[u] < m->states ? 0 : beacon * m->each);
    measure(n, row->used, at, h, h[row->used] / (r_set1(there) * told), P);
}

/* All measurements of an epoch. */
static void measured(const struct bound_task *t, const struct model *m, int n, int epoch, int first,
                     const real *p, real *s, real *P)
{
    const double there[] = {t->readings[epoch], t->packets[epoch]};
    const real all = r_set1(1.0);
    for (int r = 0; r < m->n_rows; r++)
        if (m->rows[r].counts != BEACONS)
            take(m, n, &m->rows[r], 0, there[m->rows[r].counts], all, p, s, P);
    for (int b = 0; b < t->beacons; b++) {
        const int place = epoch * t->beacons + b;
        real told = all;
        for (int lane = 0; t->told && lane < LANES; lane++) {
            const int diver = first + lane < t->divers ? first + lane : t->divers - 1;
            r_put(&told, lane, t->told[(size_t)diver * t->beacons + b]);
        }
        for (int i = 0; i < PLACES; i++)
            s[3 * PLACES + i] = r_set1(t->beacon[(size_t)place * PLACES + i]);
        for (int r = 0; r < m->n_rows; r++)
            if (m->rows[r].counts == BEACONS)
                take(m, n, &m->rows[r], b, t->heard[place], told, p, s, P);
    }
}

/* The results of an epoch, for those lanes that hold divers. */
static void keep(const struct bound_task *t, const struct model *m, int n, int kept, int first,
                 const real *p, const real *P)
{
    real v[2 * PLACES * PLACES];
    m->marginals(p, P, n, v);
    for (int lane = 0; lane < LANES && first + lane < t->divers; lane++) {
        const size_t place = ((size_t)kept * t->divers + first + lane) * PLACES * PLACES;
        for (int i = 0; i < PLACES * PLACES; i++) {
            t->absolute[place + i] = r_get(v[i], lane);
            t->relative[place + i] = r_get(v[PLACES * PLACES + i], lane);
        }
    }
}

/* The true values at an epoch, without a beacon. */
static void surroundings(const struct bound_task *t, int first, int epoch, real *s)
{
    for (int i = 0; i < PLACES; i++) {
        for (int lane = 0; lane < LANES; lane++) {
            const int diver = first + lane < t->divers ? first + lane : t->divers - 1;
            const size_t place = (size_t)epoch * t->divers + diver;
            r_put(&s[i], lane, t->position[place * PLACES + i]);
        }
        s[PLACES + i] = r_set1(t->platform[(size_t)epoch * PLACES + i]);
        s[2 * PLACES + i] = r_set1(t->attitude[(size_t)epoch * PLACES + i]);
        s[3 * PLACES + i] = r_set1(0.0);
    }
}

/* Divers from first on, one per lane. Spare lanes repeat the last diver. */
static void group(const struct bound_task *t, const struct model *m, int first)
{
    const int n = m->states + m->each * t->beacons;
    real p[MOST_PARAMETERS], s[4 * PLACES], P[MOST_STATES * MOST_STATES];
    for (int i = 0; i < m->parameters; i++)
        p[i] = r_set1(t->parameters[i]);
    for (int lane = 0; lane < LANES; lane++) {
        const int diver = first + lane < t->divers ? first + lane : t->divers - 1;
        r_put(&p[0], lane, t->acceleration_psd[diver]);
    }
    for (int epoch = 0, kept = 0; epoch < t->epochs && kept < t->kept; epoch++) {
        surroundings(t, first, epoch, s);
        if (epoch == 0)
            prior(m, t->beacons, n, p, s, P);
        /* What a ping has of its own averages out over the pings of an epoch. */
        p[m->parameters - PINGS] = r_set1(t->packets[epoch] > 0.0 ? t->packets[epoch] : 1.0);
        if (t->dt[epoch] > 0.0)
            advance(m, t->beacons, n, p, r_set1(t->dt[epoch]), P);
        measured(t, m, n, epoch, first, p, s, P);
        if (t->keep[kept] == epoch)
            keep(t, m, n, kept++, first, p, P);
    }
}

void PASTE(bound_, LANES)(const struct bound_task *task);
void PASTE(bound_, LANES)(const struct bound_task *task)
{
    for (int first = 0; first < task->divers; first += LANES)
        group(task, models[task->model], first);
}

#if LANES == 1
static int is_impossible(const struct bound_task *t)
{
    const int32_t n_models = sizeof models / sizeof *models;
    return t->model < 0 || t->model >= n_models || t->beacons < 0 || t->beacons > MOST_BEACONS;
}

#if defined(__wasm__)
__attribute__((export_name("sblcosim_bound"))) bound_entry sblcosim_bound;
int32_t sblcosim_bound(uint32_t lanes, const struct bound_task *t)
{
    if (lanes > 1 || is_impossible(t))
        return 1;
    bound_1(t);
    return 0;
}
#else
#include "widest.h"

void bound_2(const struct bound_task *task);
#if defined(__x86_64__)
void bound_4(const struct bound_task *task);
void bound_8(const struct bound_task *task);
#endif

extern EXPORT bound_entry sblcosim_bound;
int32_t sblcosim_bound(uint32_t lanes, const struct bound_task *t)
{
    if (lanes > widest() || is_impossible(t))
        return 1;
    switch (lanes ? lanes : t->divers == 1 ? 1 : widest()) {
    case 1: bound_1(t); return 0;
    case 2: bound_2(t); return 0;
#if defined(__x86_64__)
    case 4: bound_4(t); return 0;
    case 8: bound_8(t); return 0;
#endif
    default: return 1;
    }
}
#endif
#endif
