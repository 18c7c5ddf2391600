/* The smallest possible error: the covariance of a diver's position along a known path.
 *
 * The posterior Cramer-Rao recursion for many divers side by side, each alone with the beacons.
 * A plain function on plain arrays: it keeps nothing, allocates nothing and calls nobody. The
 * numbers of a diver depend neither on the others nor on the number of lanes. */
#ifndef SBLCOSIM_BOUND_H
#define SBLCOSIM_BOUND_H

#include <stdint.h>

enum bound_model {
    BOUND_PLATFORM = 0, /* beacons on a platform with sensors: that of the receiver coupled */
    BOUND_FIELD = 1,    /* beacons with errors of their own: that of long_baseline */
    BOUND_ARRAY = 2     /* as BOUND_PLATFORM, where all beacons hear a ping: that of array */
};

/* Arrays are row by row, in m, s and rad, positions in NED. */
struct bound_task {
    int32_t model;
    int32_t beacons, epochs, divers, kept;
    const double *parameters;       /* of the model, in the order of models/receiver/bound.py */
    const double *acceleration_psd; /* of each diver, in place of the first parameter */
    const double *dt;               /* time since the previous epoch; 0: nothing moves */
    const double *readings;         /* number of depth readings at each epoch */
    const double *packets;          /* number of packets at each epoch, from any beacon */
    const double *heard;            /* number of packets at each epoch, of each beacon */
    const double *told;             /* divers, beacons: share of the information in a range that is
                                       left, above 0; a null pointer: all */
    const double *position;         /* epochs, divers, 3 */
    const double *platform;         /* epochs, 3; of the reference point */
    const double *attitude;         /* epochs, 3; roll, pitch, yaw */
    const double *beacon;           /* epochs, beacons, 3; on a platform: in its body frame */
    const int32_t *keep;            /* numbers of the epochs whose results are wanted, increasing */
    double *absolute, *relative;    /* kept, divers, 3, 3: after the measurements of an epoch */
};

/* Returns 0, or 1 if the sizes are impossible or the processor does not support that many lanes.
 * lanes = 0: as many as it supports well, or one for a single diver. */
typedef int32_t bound_entry(uint32_t lanes, const struct bound_task *task);

#endif
