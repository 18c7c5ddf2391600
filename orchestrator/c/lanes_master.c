/* The lanes master: runs a plan for groups of simulations, one per lane, and reduces their errors
 * to sums as it goes. Compiled once per number of lanes. */
#include <stddef.h>
#include <string.h>

#include "lanes.h"
#include "lanes_master.h" /* enum sum and the limits, generated from lanes.py and reduction.py */
#include "real.h"

#define PASTE_(a, b) a##b
#define PASTE(a, b) PASTE_(a, b)
#define API __attribute__((visibility("default")))

/* Elements of one component's outputs that become another's inputs (or, before the start,
 * parameters); places are among all values of a component. */
struct link {
    int32_t source, from, target, to, count;
};

/* A receiver to judge: its component and the places of its ports; -1 where it has none. */
struct receiver {
    int32_t component, valid, update_count, epoch, position, covariance, nis, nis_degrees;
};

/* The truth to judge by. */
struct truth {
    int32_t target, target_position, platform, platform_position, beacon, reported, beacons;
};

struct span {
    int32_t component, from, count;
};

struct plan {
    int32_t n_components, n_links, n_handovers, n_receivers, n_spans, n_instants;
    int32_t remembered, padding; /* how many instants an epoch can be behind */
    const struct lanes *const *components;
    const int64_t *interval_ns;
    const struct link *links, *handovers;
    const struct receiver *receivers;
    const struct truth *truth;
    const struct span *spans;   /* what is recorded, if anything */
    const int64_t *instants_ns; /* the start first */
    int64_t settling_ns;        /* errors count from this time after the start */
};

/* Truth at an instant. */
struct moment {
    real time, position[3], platform_error[3], distance_square;
};

/* The newest moments, as many as an epoch can be behind; few, so that they stay in the cache. */
struct memory {
    struct moment *moments;
    int size, next, count;
};

/* Few elements at a time: a call of memcpy would cost more than the copying. */
static inline void copy(real *to, const real *from, int32_t count)
{
    for (int32_t i = 0; i < count; i++)
        to[i] = from[i];
}

static void remember(struct memory *m, const struct truth *t, const real *const *values,
                     int64_t now_ns)
{
    const real *target = values[t->target] + t->target_position;
    const real *platform = values[t->platform] + t->platform_position;
    const real *beacon = values[t->platform] + t->beacon;
    const real *reported = values[t->platform] + t->reported;
    struct moment *const moment = &m->moments[m->next];
    const real share = r_set1(1.0 / t->beacons);
    real distance_square = r_set1(0.0);
    moment->time = r_set1((double)now_ns / 1e9);
    for (int i = 0; i < 3; i++) {
        real sum = r_set1(0.0);
        for (int j = 0; j < t->beacons; j++)
            sum = sum + (reported[3 * j + i] - beacon[3 * j + i]);
        moment->platform_error[i] = sum * share;
        moment->position[i] = target[i];
        const real d = target[i] - platform[i];
        distance_square = distance_square + d * d;
    }
    moment->distance_square = distance_square;
    m->next = m->next + 1 < m->size ? m->next + 1 : 0;
    if (m->count < m->size)
        m->count++;
}

/* e' P^-1 e by P = L D L'; *usable tells where P is positive definite. */
static real nees_of(const real e[3], const real *P, mask *usable)
{
    const real a = P[0], b = P[2], c = P[4], d = P[14], f = P[16], g = P[28];
    const real zero = r_set1(0.0), one = r_set1(1.0);
    *usable = m_lt(zero, a);
    const real i1 = one / r_blend(*usable, a, one);
    const real l21 = b * i1, l31 = c * i1;
    const real s2 = d - l21 * b, r = f - l21 * c;
    *usable &= m_lt(r_set1(1e-14) * d, s2);
    const real i2 = one / r_blend(*usable, s2, one);
    const real l32 = r * i2;
    const real s3 = g - l31 * c - l32 * r;
    *usable &= m_lt(r_set1(1e-14) * g, s3);
    const real y2 = e[1] - l21 * e[0], y3 = e[2] - l31 * e[0] - l32 * y2;
    return e[0] * e[0] * i1 + y2 * y2 * i2 + y3 * y3 / r_blend(*usable, s3, one);
}

static inline void add(real *sum, mask condition, real value)
{
    *sum = *sum + r_keep(condition, value);
}

/* Judge what a receiver shows at an instant. */
static void reduce(const struct receiver *r, const real *v, const struct memory *m, real *counted,
                   double settled, double late, real hold_ns, real *s)
{
    const real count = v[r->update_count], one = r_set1(1.0), zero = r_set1(0.0);
    const mask valid = r->valid >= 0 ? m_true(v[r->valid]) : m_lt(zero, count);
    add(&s[AVAILABLE_NS], valid, hold_ns);
    const mask new = m_ne(count, *counted) & valid;
    *counted = count;
    s[UPDATES] = count;
    if (!m_any(new))
        return;
    const real epoch = v[r->epoch];
    mask missing = new;
    real position[3], platform[3], distance_square = zero;
    for (int i = 0; i < 3; i++)
        position[i] = platform[i] = zero;
    for (int age = 1, at = m->next; age <= m->count && m_any(missing); age++) {
        at = at > 0 ? at - 1 : m->size - 1;
        const struct moment *const moment = &m->moments[at];
        const mask here = missing & m_eq(epoch, moment->time);
        if (!m_any(here))
            continue;
        for (int i = 0; i < 3; i++) {
            position[i] = r_blend(here, moment->position[i], position[i]);
            platform[i] = r_blend(here, moment->platform_error[i], platform[i]);
        }
        distance_square = r_blend(here, moment->distance_square, distance_square);
        missing &= ~here;
    }
    real e[3], relative[3];
    for (int i = 0; i < 3; i++) {
        e[i] = v[r->position + i] - position[i];
        relative[i] = e[i] - platform[i];
    }
    const real square = e[0] * e[0] + e[1] * e[1] + e[2] * e[2];
    const real relative_square =
        relative[0] * relative[0] + relative[1] * relative[1] + relative[2] * relative[2];
    const mask finite = m_lt(square + relative_square, r_set1(__builtin_inf()));
    const mask good = new & finite & ~missing;
    add(&s[BROKEN], new & ~good, one);
    const mask is_late = good & m_le(r_set1(late), epoch);
    if (m_any(is_late)) {
        add(&s[LATE_ESTIMATES], is_late, one);
        add(&s[LATE_ERROR_SQUARE], is_late, square);
        add(&s[LATE_DISTANCE_SQUARE], is_late, distance_square);
    }
    const mask use = good & m_le(r_set1(settled), epoch);
    add(&s[ESTIMATES], use, one);
    for (int i = 0; i < 3; i++) {
        add(&s[ERROR_X + i], use, e[i]);
        add(&s[SQUARE_X + i], use, e[i] * e[i]);
        add(&s[RELATIVE_X + i], use, relative[i]);
        add(&s[RELATIVE_SQUARE_X + i], use, relative[i] * relative[i]);
    }
    add(&s[ERROR_TOTAL], use, r_sqrt(square));
    add(&s[RELATIVE_TOTAL], use, r_sqrt(relative_square));
    if (r->covariance >= 0) {
        mask usable;
        const real nees = nees_of(e, v + r->covariance, &usable);
        usable &= use;
        add(&s[NEES], usable, nees);
        add(&s[NEES_ESTIMATES], usable, one);
    }
    if (r->nis >= 0 && r->nis_degrees >= 0) {
        const mask judged = use & m_lt(zero, v[r->nis_degrees]);
        add(&s[NIS], judged, v[r->nis]);
        add(&s[NIS_DEGREES], judged, v[r->nis_degrees]);
        add(&s[NIS_ESTIMATES], judged, one);
    }
}

#if LANES == 1
API extern const uint32_t sblcosim_lanes_version;
const uint32_t sblcosim_lanes_version = LANES_VERSION;
#endif

/* Run groups one after another.
 *
 * blocks: memory of each component, aligned to 64; held: for a component that is not due at every
 * instant, memory for what it showed when it was due last, else NULL. moments: room for
 * p->remembered moments of 8 values each, aligned to 64. values[c]: parameters and
 * inputs of component c at the start, (groups, elements, LANES). sums: (groups, receivers, SUMS,
 * LANES). record: (groups, instants, elements of all spans, LANES) or NULL. done counts instants.
 *
 * Returns 0; -1 if *cancel became nonzero; else 1-based component + (1-based element << 16) of a
 * parameter that cannot be run side by side. */
API int64_t PASTE(sblcosim_drive_, LANES)(const struct plan *p, void *const *blocks,
                                          double *const *held, void *moments,
                                          int64_t groups,
                                          const double *const *values, double *sums,
                                          double *record, const volatile int32_t *cancel,
                                          volatile int64_t *done)
{
    const int64_t start = p->instants_ns[0];
    const int64_t stop = p->instants_ns[p->n_instants - 1];
    const double settled = (double)(start + p->settling_ns) / 1e9;
    const double late = (double)stop / 1e9 - ((double)stop / 1e9 - (double)start / 1e9) / 4;
    const real *shown[MAX_COMPONENTS];
    int due[MAX_COMPONENTS] = {0};
    int64_t next[MAX_COMPONENTS] = {0};
    for (int c = 0; c < p->n_components; c++)
        shown[c] = held[c] ? (const real *)held[c] : (const real *)blocks[c];
    for (int64_t g = 0; g < groups; g++) {
        struct memory memory = {moments, p->remembered, 0, 0};
        real counted[MAX_RECEIVERS], total[MAX_RECEIVERS][SUMS];
        for (int r = 0; r < p->n_receivers; r++) {
            counted[r] = r_set1(0.0);
            for (int i = 0; i < SUMS; i++)
                total[r][i] = r_set1(0.0);
        }
        for (int c = 0; c < p->n_components; c++) {
            const struct lanes *k = p->components[c];
            const size_t n = (size_t)(k->parameters + k->inputs) * LANES;
            next[c] = start;
            memset(blocks[c], 0, k->block_size);
            memcpy(blocks[c], values[c] + (size_t)g * n, n * sizeof(double));
            for (int i = 0; i < p->n_handovers; i++) {
                const struct link *l = &p->handovers[i];
                if (l->target == c)
                    copy((real *)blocks[c] + l->to, (const real *)blocks[l->source] + l->from,
                         l->count);
            }
            const uint32_t element = k->initial(blocks[c], start);
            if (element)
                return c + 1 + ((int64_t)element << 16);
        }
        for (int row = 0; row < p->n_instants; row++) {
            const int64_t now = p->instants_ns[row];
            const int last = row == p->n_instants - 1;
            if (*cancel)
                return -1;
            for (int c = 0; c < p->n_components; c++) {
                const struct lanes *k = p->components[c];
                due[c] = now == next[c];
                if (due[c])
                    next[c] += p->interval_ns[c];
                if (held[c] && due[c])
                    memcpy(held[c], blocks[c],
                           (size_t)(k->parameters + k->inputs + k->outputs) * sizeof(real));
            }
            if (p->truth) {
                const real hold =
                    r_set1(last ? 0.0 : (double)(p->instants_ns[row + 1] - now));
                remember(&memory, p->truth, shown, now);
                for (int r = 0; r < p->n_receivers; r++)
                    reduce(&p->receivers[r], shown[p->receivers[r].component], &memory,
                           &counted[r], settled, late, hold, total[r]);
            }
            if (record)
                for (int i = 0; i < p->n_spans; i++) {
                    const size_t n = (size_t)p->spans[i].count * LANES;
                    memcpy(record, shown[p->spans[i].component] + p->spans[i].from,
                           n * sizeof(double));
                    record += n;
                }
            if (last)
                break;
            for (int i = 0; i < p->n_links; i++) {
                const struct link *l = &p->links[i];
                if (due[l->target])
                    copy((real *)blocks[l->target] + l->to, shown[l->source] + l->from, l->count);
            }
            for (int c = 0; c < p->n_components; c++)
                if (due[c])
                    p->components[c]->step(blocks[c], start, now, now + p->interval_ns[c]);
            *done += 1;
        }
        for (int r = 0; r < p->n_receivers; r++)
            for (int i = 0; i < SUMS; i++, sums += LANES)
                r_store(sums, total[r][i]);
    }
    return 0;
}
