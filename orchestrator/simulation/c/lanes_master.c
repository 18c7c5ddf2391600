/* The lanes master: runs a plan for groups of simulations, one per lane, and reduces their errors
 * to sums as it goes, by the definitions of definitions.py and to their bits. Compiled once per
 * number of lanes. */
#include <stddef.h>
#include <string.h>

#include "lanes.h"
#include "lanes_master.h" /* enum sum and the limits, generated from lanes.py and reduction.py */
#include "real.h"

#define PASTE_(a, b) a##b
#define PASTE(a, b) PASTE_(a, b)
#define API __attribute__((visibility("default")))
#define SECOND INT64_C(1000000000)
#define MOST_SECONDS 9e9 /* of what can be counted in ns */
#define PIVOT 1e-14      /* least share of a diagonal element that is left of it as a pivot */

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
    int32_t target, target_position, target_velocity, platform, platform_position, beacon, reported,
        beacons;
};

struct span {
    int32_t component, from, count;
};

struct plan {
    int32_t n_components, n_links, n_handovers, n_receivers, n_spans, n_instants;
    int32_t remembered; /* how many instants an epoch can be behind */
    int32_t sparse;     /* whether some instants are none of the target's own */
    const struct lanes *const *components;
    const int64_t *interval_ns;
    const struct link *links, *handovers;
    const struct receiver *receivers;
    const struct truth *truth;
    const struct span *spans;   /* what is recorded, if anything */
    const int64_t *instants_ns; /* the start first */
    int64_t settling_ns;        /* errors count from this time after the start */
};

/* What an instant shows of target and platform. */
struct moment {
    real time, position[3], velocity[3], platform_error[3], platform[3];
};
_Static_assert(sizeof(struct moment) == MOMENT * sizeof(real), "as lanes.py allocates it");

/* The newest moments, as many as an epoch can be behind; few, so that they stay in the cache. */
struct memory {
    struct moment *moments;
    int size, next, count, row; /* of the newest */
};

/* Few elements at a time: a call of memcpy would cost more than the copying. */
static inline void copy(real *to, const real *from, int32_t count)
{
    for (int32_t i = 0; i < count; i++)
        to[i] = from[i];
}

static void remember(struct memory *m, const struct truth *t, const real *const *values,
                     int row, int64_t now_ns)
{
    const real *target = values[t->target] + t->target_position;
    const real *velocity = values[t->target] + t->target_velocity;
    const real *platform = values[t->platform] + t->platform_position;
    const real *beacon = values[t->platform] + t->beacon;
    const real *reported = values[t->platform] + t->reported;
    struct moment *const moment = &m->moments[m->next];
    const real share = r_set1(1.0 / t->beacons);
    moment->time = r_set1((double)now_ns / 1e9);
    for (int i = 0; i < 3; i++) {
        real sum = r_set1(0.0);
        for (int j = 0; j < t->beacons; j++)
            sum = sum + (reported[3 * j + i] - beacon[3 * j + i]);
        moment->platform_error[i] = sum * share;
        moment->position[i] = target[i];
        moment->velocity[i] = velocity[i];
        moment->platform[i] = platform[i];
    }
    m->row = row;
    m->next = m->next + 1 < m->size ? m->next + 1 : 0;
    if (m->count < m->size)
        m->count++;
}

static const struct moment *moment_of(const struct memory *m, int row)
{
    const int at = m->next - 1 - (m->row - row);
    return &m->moments[at < 0 ? at + m->size : at];
}

/* Whether an instant is one of the target's own; at others it shows an older state. */
static int is_own(const struct plan *p, int row)
{
    return !p->sparse
           || (p->instants_ns[row] - p->instants_ns[0]) % p->interval_ns[p->truth->target] == 0;
}

enum knowledge { OUTSIDE, UNKNOWN, KNOWN };

/* The truth at any epoch, for one lane. */
struct sight {
    double epoch, position[3], platform_error[3], platform[3];
};

/* Look up the truth at sight->epoch: OUTSIDE of the run; UNKNOWN if it is older than the memory or
 * ahead of it; or KNOWN, and the epoch is matched to the instants. */
static enum knowledge look_up(const struct plan *p, const struct memory *m, int lane,
                              struct sight *sight)
{
    const int64_t *const t = p->instants_ns;
    const int oldest = m->row - m->count + 1;
    const double epoch = sight->epoch;
    if (!(__builtin_fabs(epoch) < MOST_SECONDS))
        return OUTSIDE;
    const int64_t whole = (int64_t)epoch;
    const double rest = (epoch - (double)whole) * 1e9;
    int64_t ns = whole * SECOND + (int64_t)((rest + 0x1.8p52) - 0x1.8p52);
    int held = m->row;
    while (held >= oldest && t[held] > ns)
        held--;
    if (held >= oldest && (double)t[held] / 1e9 == epoch)
        ns = t[held];
    else if (held < m->row && (double)t[held + 1] / 1e9 == epoch)
        ns = t[++held];
    if (ns < t[0] || ns > t[p->n_instants - 1])
        return OUTSIDE;
    if (held < oldest || (held == m->row && ns != t[held]))
        return UNKNOWN;
    int before = held;
    while (before >= oldest && !is_own(p, before))
        before--;
    if (before < oldest)
        return UNKNOWN;
    int after = ns == t[before] ? before : held + 1;
    while (after <= m->row && !is_own(p, after))
        after++;
    if (after > m->row)
        return UNKNOWN;
    const struct moment *const one = moment_of(m, before), *const other = moment_of(m, after);
    const struct moment *const shown = moment_of(m, held);
    const double step = (double)(t[after] - t[before]), h = step * 1e-9;
    const double u = (double)(ns - t[before]) / step;
    sight->epoch = (double)ns / 1e9;
    for (int i = 0; i < 3; i++) {
        const double p0 = r_get(one->position[i], lane), p1 = r_get(other->position[i], lane);
        const double v0 = r_get(one->velocity[i], lane), v1 = r_get(other->velocity[i], lane);
        const double secant = (p1 - p0) / h;
        const double b = 3 * secant - 2 * v0 - v1, a = v0 + v1 - 2 * secant;
        sight->position[i] = before == after ? p0 : p0 + h * u * (v0 + u * (b + u * a));
        sight->platform_error[i] = r_get(shown->platform_error[i], lane);
        sight->platform[i] = r_get(shown->platform[i], lane);
    }
    return KNOWN;
}

/* e' P^-1 e by P = L D L'; *usable tells where P is positive definite. */
static real nees_of(const real e[3], const real *P, mask *usable)
{
    const real a = P[0], b = P[2], c = P[4], d = P[14], f = P[16], g = P[28];
    const real one = r_set1(1.0), least = r_set1(PIVOT);
    *usable = m_lt(least * a, a);
    const real i1 = one / r_blend(*usable, a, one);
    const real l21 = b * i1, l31 = c * i1;
    const real s2 = d - l21 * b, r = f - l21 * c;
    *usable &= m_lt(least * d, s2);
    const real i2 = one / r_blend(*usable, s2, one);
    const real l32 = r * i2;
    const real s3 = g - l31 * c - l32 * r;
    *usable &= m_lt(least * g, s3);
    const real y2 = e[1] - l21 * e[0], y3 = e[2] - l31 * e[0] - l32 * y2;
    return e[0] * e[0] * i1 + y2 * y2 * i2 + y3 * y3 / r_blend(*usable, s3, one);
}

static inline void add(real *sum, mask condition, real value)
{
    *sum = *sum + r_keep(condition, value);
}

/* Judge what a receiver shows at an instant. squares: room for those of this instant's estimates,
 * LENGTHS of them, or NULL; infinite where a lane has none. Returns whether there is any. */
static int reduce(const struct plan *p, const struct receiver *r, const real *v,
                  const struct memory *m, real *counted, double settled, double late,
                  real hold_ns, real *s, double *squares)
{
    const real count = v[r->update_count], one = r_set1(1.0), zero = r_set1(0.0);
    const mask valid = r->valid >= 0 ? m_true(v[r->valid]) : m_lt(zero, count);
    add(&s[AVAILABLE_NS], valid, hold_ns);
    mask new = m_ne(count, *counted) & valid;
    *counted = count;
    s[UPDATES] = count;
    if (!m_any(new))
        return 0;
    real epoch = v[r->epoch];
    mask missing = new;
    real position[3], platform_error[3], platform[3];
    for (int i = 0; i < 3; i++)
        position[i] = platform_error[i] = platform[i] = zero;
    for (int age = 1, at = m->next; age <= m->count && m_any(missing); age++) {
        at = at > 0 ? at - 1 : m->size - 1;
        const struct moment *const moment = &m->moments[at];
        const mask here = missing & m_eq(epoch, moment->time);
        if (!m_any(here) || !is_own(p, m->row - age + 1))
            continue;
        for (int i = 0; i < 3; i++) {
            position[i] = r_blend(here, moment->position[i], position[i]);
            platform_error[i] = r_blend(here, moment->platform_error[i], platform_error[i]);
            platform[i] = r_blend(here, moment->platform[i], platform[i]);
        }
        missing &= ~here;
    }
    if (m_any(missing)) {
        const real wanted = r_truth(missing);
        real known = zero, unknown = zero;
        for (int lane = 0; lane < LANES; lane++) {
            struct sight sight = {.epoch = r_get(epoch, lane)};
            if (r_get(wanted, lane) == 0.0)
                continue;
            switch (look_up(p, m, lane, &sight)) {
            case KNOWN:
                r_put(&known, lane, 1.0);
                r_put(&epoch, lane, sight.epoch);
                for (int i = 0; i < 3; i++) {
                    r_put(&position[i], lane, sight.position[i]);
                    r_put(&platform_error[i], lane, sight.platform_error[i]);
                    r_put(&platform[i], lane, sight.platform[i]);
                }
                break;
            case UNKNOWN:
                r_put(&unknown, lane, 1.0);
                break;
            case OUTSIDE:
                break;
            }
        }
        add(&s[UNJUDGED], m_true(unknown), one);
        missing &= ~m_true(known);
        new &= ~m_true(unknown);
    }
    real e[3], relative[3];
    for (int i = 0; i < 3; i++) {
        e[i] = v[r->position + i] - position[i];
        relative[i] = e[i] - platform_error[i];
    }
    const real square = e[0] * e[0] + e[1] * e[1] + e[2] * e[2];
    const real relative_square =
        relative[0] * relative[0] + relative[1] * relative[1] + relative[2] * relative[2];
    const mask finite = m_lt(square + relative_square, r_set1(__builtin_inf()));
    const mask good = new & finite & ~missing;
    add(&s[BROKEN], new & ~good, one);
    const mask is_late = good & m_le(r_set1(late), epoch);
    if (m_any(is_late)) {
        real distance_square = zero;
        for (int i = 0; i < 3; i++) {
            const real d = position[i] - platform[i];
            distance_square = distance_square + d * d;
        }
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
    if (r->nis >= 0) {
        const real degrees = r->nis_degrees >= 0 ? v[r->nis_degrees] : zero;
        const mask judged = r->nis_degrees >= 0 ? use & m_lt(zero, degrees) : use;
        add(&s[NIS], judged, v[r->nis]);
        add(&s[NIS_DEGREES], judged, degrees);
        add(&s[NIS_ESTIMATES], judged, one);
    }
    if (squares == NULL || !m_any(use))
        return 0;
    const real none = r_set1(__builtin_inf());
    r_store(squares + LENGTH_ABSOLUTE_HORIZONTAL * LANES,
            r_blend(use, e[0] * e[0] + e[1] * e[1], none));
    r_store(squares + LENGTH_ABSOLUTE_TOTAL * LANES, r_blend(use, square, none));
    r_store(squares + LENGTH_RELATIVE_HORIZONTAL * LANES,
            r_blend(use, relative[0] * relative[0] + relative[1] * relative[1], none));
    r_store(squares + LENGTH_RELATIVE_TOTAL * LANES, r_blend(use, relative_square, none));
    return 1;
}

#if LANES == 1
API extern const uint32_t sblcosim_lanes_version;
const uint32_t sblcosim_lanes_version = LANES_VERSION;
#endif

/* Run groups one after another.
 *
 * blocks: memory of each component, aligned to 64; held: for a component that is not due at every
 * instant, memory for what it showed when it was due last, else NULL. moments: room for
 * p->remembered moments of MOMENT values each, aligned to 64. values[c]: parameters and
 * inputs of component c at the start, (groups, elements, LANES). sums: (groups, receivers, SUMS,
 * LANES). record: (groups, instants, elements of all spans, LANES) or NULL. squares: of the lengths
 * of the errors, (groups, receivers, room, LENGTHS, LANES), or NULL; filled: how many rows of each
 * have some, (groups, receivers). done counts instants.
 *
 * Returns 0; -1 if *cancel became nonzero; -2 if there is no room for more squares; else 1-based component + (1-based element << 16) of a
 * parameter that cannot be run side by side. */
API int64_t PASTE(sblcosim_drive_, LANES)(const struct plan *p, void *const *blocks,
                                          double *const *held, void *moments,
                                          int64_t groups,
                                          const double *const *values, double *sums,
                                          double *record, double *squares, int64_t room,
                                          int64_t *filled, const volatile int32_t *cancel,
                                          volatile int64_t *done)
{
    const int64_t start = p->instants_ns[0];
    const int64_t stop = p->instants_ns[p->n_instants - 1];
    const double settled = (double)(start + p->settling_ns) / 1e9;
    const double late = (double)(stop - (stop - start) / 4) / 1e9;
    const real *shown[MAX_COMPONENTS];
    int due[MAX_COMPONENTS] = {0};
    int64_t next[MAX_COMPONENTS] = {0};
    for (int c = 0; c < p->n_components; c++)
        shown[c] = held[c] ? (const real *)held[c] : (const real *)blocks[c];
    for (int64_t g = 0; g < groups; g++) {
        struct memory memory = {moments, p->remembered, 0, 0, 0};
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
                remember(&memory, p->truth, shown, row, now);
                for (int r = 0; r < p->n_receivers; r++) {
                    const int64_t of = g * p->n_receivers + r;
                    double *const row_of = squares
                        ? squares + (of * room + filled[of]) * LENGTHS * LANES : NULL;
                    if (squares && filled[of] == room)
                        return -2;
                    if (reduce(p, &p->receivers[r], shown[p->receivers[r].component], &memory,
                               &counted[r], settled, late, hold, total[r], row_of))
                        filled[of]++;
                }
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
