/* Snapshots of an instance, kept in memory or serialized: a copy of its numbers under a header. */
#ifndef SBLCOSIM_SNAPSHOTS_H
#define SBLCOSIM_SNAPSHOTS_H

#include "instance.h"

#define SNAPSHOT_MAGIC 0x53424c46u /* "SBLF" */
#define SNAPSHOT_VERSION 1u

struct snapshot {
    uint32_t magic, version;
    uint64_t size;
    uint64_t checksum; /* 0 except in the serialized form */
    char token[sizeof MODEL_TOKEN];
    struct data data;
};

static void snapshot_take(const struct instance *in, struct snapshot *s)
{
    memset(s, 0, sizeof *s);
    s->magic = SNAPSHOT_MAGIC;
    s->version = SNAPSHOT_VERSION;
    s->size = sizeof *s;
    memcpy(s->token, MODEL_TOKEN, sizeof s->token);
    s->data = in->data;
}

static enum status snapshot_check(const struct instance *in, const struct snapshot *s)
{
    if (s->magic != SNAPSHOT_MAGIC || s->version != SNAPSHOT_VERSION || s->size != sizeof *s
        || memcmp(s->token, MODEL_TOKEN, sizeof s->token) != 0)
        return report(in, ERROR, "the state is not one of this FMU");
    return OK;
}

/* A new snapshot, or an old one overwritten. */
static enum status snapshot_get(const struct instance *in, void **state)
{
    struct snapshot *s = *state ? *state : malloc(sizeof *s);
    if (!s)
        return report(in, ERROR, "no memory for the state");
    snapshot_take(in, s);
    *state = s;
    return OK;
}

static enum status snapshot_set(struct instance *in, const void *state)
{
    const enum status status = snapshot_check(in, state);
    if (status == OK)
        in->data = ((const struct snapshot *)state)->data;
    return status;
}

/* FNV-1a over all other bytes. */
static uint64_t snapshot_checksum(const struct snapshot *s)
{
    struct snapshot copy;
    unsigned char bytes[sizeof copy];
    uint64_t hash = UINT64_C(0xcbf29ce484222325);
    memcpy(&copy, s, sizeof copy);
    copy.checksum = 0;
    memcpy(bytes, &copy, sizeof copy);
    for (size_t i = 0; i < sizeof copy; i++)
        hash = (hash ^ bytes[i]) * UINT64_C(0x100000001b3);
    return hash;
}

static enum status snapshot_serialize(const struct instance *in, const void *state,
                                      unsigned char *bytes, size_t size)
{
    struct snapshot outgoing;
    const enum status status = snapshot_check(in, state);
    if (status != OK)
        return status;
    if (size < sizeof(struct snapshot))
        return report(in, ERROR, "the serialized state takes %zu bytes, got room for %zu",
                      sizeof(struct snapshot), size);
    memcpy(&outgoing, state, sizeof outgoing);
    outgoing.checksum = snapshot_checksum(&outgoing);
    memcpy(bytes, &outgoing, sizeof outgoing);
    return OK;
}

static enum status snapshot_deserialize(const struct instance *in, const unsigned char *bytes,
                                        size_t size, void **state)
{
    struct snapshot incoming;
    if (size != sizeof incoming)
        return report(in, ERROR, "the serialized state must have %zu bytes, got %zu",
                      sizeof incoming, size);
    memcpy(&incoming, bytes, sizeof incoming);
    const enum status status = snapshot_check(in, &incoming);
    if (status != OK)
        return status;
    if (incoming.checksum != snapshot_checksum(&incoming))
        return report(in, ERROR, "the serialized state is damaged");
    incoming.checksum = 0;
    struct snapshot *s = *state ? *state : malloc(sizeof *s);
    if (!s)
        return report(in, ERROR, "no memory for the state");
    memcpy(s, &incoming, sizeof *s);
    *state = s;
    return OK;
}

#endif
