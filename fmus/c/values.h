/* Getting and setting values, and derivatives of outputs: references are checked before any value
 * is read, and all values before one is set. */
#ifndef SBLCOSIM_VALUES_H
#define SBLCOSIM_VALUES_H

#include "instance.h"
#include "life_cycle.h"

/* The element of a value reference, or N_VALUES. */
static unsigned element_of(unsigned reference)
{
    const unsigned element = reference - FIRST_REFERENCE;
    return element < N_VALUES ? element : N_VALUES;
}

static enum status check_type(const struct instance *in, const char *function, unsigned element,
                              enum type type)
{
    static const char *const names[] = {"Float64 (Real)", "Int32 (Integer)", "Boolean"};
    const struct variable *v = &variables[owner[element]];
    if (v->type == type)
        return OK;
    return report(in, ERROR, "%s: %s is of type %s, not %s", function, v->name, names[v->type],
                  names[type]);
}

/* Bring the outputs up to date before they are read. */
static enum status instance_refresh(struct instance *in)
{
    if (!in->data.stale)
        return OK;
    if (in->data.mode == INITIALIZATION) {
        const enum status status = instance_initialise(in);
        if (status != OK)
            return status;
    } else
        engine_output(&in->data.block, in->data.variant, in->data.time_ns);
    const enum status status = instance_check_finite(in);
    in->data.stale = status != OK;
    return status;
}

/* Why a value cannot be set, or NULL. */
static const char *refusal(const struct instance *in, const struct variable *v, double value)
{
    if (v->causality == OUTPUT)
        return "is an output and cannot be set; got";
    if (v->causality == PARAMETER && !(in->data.mode & (INSTANTIATED | INITIALIZATION)))
        return "is a fixed parameter and cannot be set after initialization; got";
    if (!__builtin_isfinite(value))
        return "must be finite, got";
    if (v->causality == PARAMETER && !(value >= v->min && value <= v->max))
        return "is out of its range, got";
    return NULL;
}

static enum status check_value(const struct instance *in, const char *function, unsigned element,
                               double value)
{
    const struct variable *v = &variables[owner[element]];
    const char *reason = refusal(in, v, value);
    if (!reason)
        return OK;
    char name[128];
    element_name(element, name, sizeof name);
    if (v->causality == PARAMETER && (v->min > -INFINITY || v->max < INFINITY))
        return report(in, ERROR, "%s: %s (%.9g to %.9g) %s %.17g", function, name, v->min, v->max,
                      reason, value);
    return report(in, ERROR, "%s: %s %s %.17g", function, name, reason, value);
}

/* How many elements a reference stands for: its variable, or only itself without arrays. */
static unsigned extent(unsigned element)
{
    return ARRAYS ? variables[owner[element]].size : 1;
}

/* Consecutive elements that can be read or written at once: an array, or scalars with consecutive
 * references and the same type and causality. */
struct piece {
    unsigned first, size;
    size_t references;
};

static struct piece next_piece(const unsigned references[], size_t n)
{
    struct piece piece = {element_of(references[0]), 0, 1};
    if (piece.first == N_VALUES)
        return piece;
    piece.size = extent(piece.first);
    if (!ARRAYS) {
        while (piece.references < n && piece.references < alike[piece.first]
               && references[piece.references] == references[0] + piece.references)
            piece.references++;
        piece.size = (unsigned)piece.references;
    }
    return piece;
}

static int is_time(unsigned reference, enum type type)
{
    return ARRAYS && reference == 0 && type == FLOAT64;
}

/* Check references and the number of values before anything is read or written. */
static enum status check_access(const struct instance *in, const char *function, enum type type,
                                const unsigned references[], size_t n, const void *values,
                                size_t n_values)
{
    size_t count = 0;
    if (n > 0 && (!references || !values))
        return report(in, ERROR, "%s: the arrays must not be null", function);
    for (size_t i = 0; i < n;) {
        if (is_time(references[i], type)) {
            count++, i++;
            continue;
        }
        const struct piece piece = next_piece(references + i, n - i);
        if (!piece.size || (ARRAYS && variables[owner[piece.first]].reference != references[i]))
            return report(in, ERROR, "%s: there is no variable with value reference %u", function,
                          references[i]);
        const enum status status = check_type(in, function, piece.first, type);
        if (status != OK)
            return status;
        count += piece.size;
        i += piece.references;
    }
    if (count != n_values)
        return report(in, ERROR, "%s: the variables have %zu values, got room for %zu", function,
                      count, n_values);
    return OK;
}

static double value_at(const void *values, enum type type, size_t i)
{
    switch (type) {
    case FLOAT64: return ((const double *)values)[i];
    case INT32: return ((const int32_t *)values)[i];
    default: return ((const boolean *)values)[i] ? 1.0 : 0.0;
    }
}

static enum status instance_get(struct instance *in, const char *function, enum type type,
                                const unsigned references[], size_t n, void *values,
                                size_t n_values)
{
    enum status status = require(in, READABLE, function);
    if (status == OK)
        status = check_access(in, function, type, references, n, values, n_values);
    if (status == OK)
        status = instance_refresh(in);
    if (status != OK)
        return status;
    size_t index = 0;
    for (size_t i = 0; i < n;) {
        if (is_time(references[i], type)) {
            ((double *)values)[index++] = (double)in->data.time_ns / 1e9;
            i++;
            continue;
        }
        const struct piece piece = next_piece(references + i, n - i);
        const double *from = in->data.block.v + piece.first;
        switch (type) {
        case FLOAT64:
            memcpy((double *)values + index, from, piece.size * sizeof *from);
            break;
        case INT32:
            for (unsigned j = 0; j < piece.size; j++)
                ((int32_t *)values)[index + j] = (int32_t)from[j];
            break;
        case BOOLEAN:
            for (unsigned j = 0; j < piece.size; j++)
                ((boolean *)values)[index + j] = from[j] != 0.0;
            break;
        }
        index += piece.size;
        i += piece.references;
    }
    return OK;
}

/* Check the values of a piece, or set them. */
static enum status piece_set(struct instance *in, const char *function, enum type type,
                             const struct piece *piece, const void *values, size_t index, int write)
{
    double *to = in->data.block.v + piece->first;
    const int input = variables[owner[piece->first]].causality == INPUT;
    if (input && type == FLOAT64) { /* the many values of every step */
        const double *from = (const double *)values + index;
        if (write)
            memcpy(to, from, piece->size * sizeof *to);
        if (write || all_finite(from, piece->size))
            return OK;
    }
    for (unsigned j = 0; j < piece->size; j++) {
        const double value = value_at(values, type, index + j);
        const enum status status =
            write ? OK : check_value(in, function, piece->first + j, value);
        if (status != OK)
            return status;
        if (write)
            to[j] = value;
    }
    return OK;
}

static enum status instance_set(struct instance *in, const char *function, enum type type,
                                const unsigned references[], size_t n, const void *values,
                                size_t n_values)
{
    enum status status = require(in, INSTANTIATED | INITIALIZATION | STEP, function);
    if (status == OK)
        status = check_access(in, function, type, references, n, values, n_values);
    if (status != OK)
        return status;
    for (int write = 0; write < 2; write++) { /* all values are checked before one is set */
        size_t index = 0;
        for (size_t i = 0; i < n;) {
            if (is_time(references[i], type))
                return report(in, ERROR, "%s: time cannot be set", function);
            const struct piece piece = next_piece(references + i, n - i);
            if ((status = piece_set(in, function, type, &piece, values, index, write)) != OK)
                return status;
            index += piece.size;
            i += piece.references;
        }
    }
    /* Outputs at the start follow from parameters; later only direct feedthrough matters. */
    if (n > 0 && (in->data.mode != STEP || HAS_JACOBIAN))
        in->data.stale = 1;
    return OK;
}

/* sensitivity = (d unknowns / d knowns) seed, for outputs and inputs with direct feedthrough. */
static enum status instance_derivative(struct instance *in, const char *function,
                                       const unsigned unknowns[], size_t n_unknowns,
                                       const unsigned knowns[], size_t n_knowns,
                                       const double seed[], size_t n_seed, double sensitivity[],
                                       size_t n_sensitivity)
{
#if HAS_JACOBIAN
    enum status status = require(in, INITIALIZATION | STEP | TERMINATED, function);
    if (status == OK)
        status = check_access(in, function, FLOAT64, unknowns, n_unknowns, sensitivity,
                              n_sensitivity);
    if (status == OK)
        status = check_access(in, function, FLOAT64, knowns, n_knowns, seed, n_seed);
    if (status == OK)
        status = instance_refresh(in);
    if (status != OK)
        return status;
    for (size_t i = 0; i < n_unknowns + n_knowns; i++) {
        const unsigned reference = i < n_unknowns ? unknowns[i] : knowns[i - n_unknowns];
        const enum causality wanted = i < n_unknowns ? OUTPUT : INPUT;
        const unsigned element = element_of(reference);
        if (element == N_VALUES || variables[owner[element]].causality != wanted)
            return report(in, ERROR, "%s: the variable with value reference %u is not an %s",
                          function, reference, wanted == INPUT ? "input" : "output");
    }
    struct data *d = &in->data;
    real jacobian[N_Y * N_U];
    model_jacobian(d->variant, engine_x(&d->block), engine_u(&d->block), engine_p(&d->block),
                   engine_seconds(d->time_ns), jacobian);
    size_t row = 0;
    for (size_t i = 0; i < n_unknowns; i++) {
        const unsigned output = element_of(unknowns[i]);
        for (unsigned y = output; y < output + extent(output); y++, row++) {
            size_t column = 0;
            double sum = 0.0;
            for (size_t j = 0; j < n_knowns; j++) {
                const unsigned input = element_of(knowns[j]);
                for (unsigned u = input; u < input + extent(input); u++, column++)
                    sum += jacobian[(y - N_P - N_U) * N_U + (u - N_P)] * seed[column];
            }
            if (!__builtin_isfinite(sum)) {
                char name[128];
                element_name(y, name, sizeof name);
                return report(in, DISCARD, "%s: %s has no derivative here, got %g", function, name,
                              sum);
            }
            sensitivity[row] = sum;
        }
    }
    return OK;
#else
    (void)unknowns, (void)n_unknowns, (void)knowns, (void)n_knowns;
    (void)seed, (void)n_seed, (void)sensitivity, (void)n_sensitivity;
    return report(in, ERROR, "%s: no output depends directly on an input", function);
#endif
}

#endif
