/* What is possible at best: the covariance of a diver's place along a known path.
 *
 * The posterior Cramer-Rao recursion for many divers side by side, each alone with the beacons.
 * A plain function over plain arrays: it keeps nothing, allocates nothing and calls nobody. The
 * numbers of a diver depend neither on the others nor on the number of lanes. */
#ifndef SBLCOSIM_BOUND_H
#define SBLCOSIM_BOUND_H

#include <stdint.h>

enum bound_model {
    BOUND_PLATFORM = 0, /* beacons on a platform with sensors: that of the receiver coupled */
    BOUND_FIELD = 1     /* beacons with errors of their own: that of long_baseline */
};

/* Arrays are row by row, in m, s and rad, places in NED. */
struct bound_task {
    int32_t model;
    int32_t beacons, epochs, divers, kept;
    const double *parameters;       /* of the model, in the order of models/receiver/bound.py */
    const double *acceleration_psd; /* of each diver, in place of the first parameter */
    const double *dt;               /* time since the epoch before; 0: nothing moves */
    const double *readings;         /* of the depth sensor at each epoch: their number */
    const double *packets;          /* at each epoch, whatever beacon they come from */
    const double *heard;            /* at each epoch, of each beacon */
    const double *position;         /* epochs, divers, 3 */
    const double *platform;         /* epochs, 3; of the reference point */
    const double *attitude;         /* epochs, 3; roll, pitch, yaw */
    const double *beacon;           /* epochs, beacons, 3; of a platform in its body frame */
    const int32_t *keep;            /* numbers of the epochs whose results are wanted, increasing */
    double *absolute, *relative;    /* kept, divers, 3, 3: after the measurements of an epoch */
};

/* Returns 0, or 1 where the sizes are not possible or the processor cannot do that many lanes.
 * lanes = 0: as many as it does well, and one for a single diver. */
typedef int32_t bound_entry(uint32_t lanes, const struct bound_task *task);

#endif
