/* Order statistics of columns of squared lengths, side by side.
 *
 * Sorting takes longer, on some processors many times longer. Here each value gets a key of 15 bits
 * that grows with it, and the key of the wanted value is found bit by bit: a bit is set if the
 * number
 * of values with a key below does not exceed the rank. One comparison does this for all columns.
 * Few
 * values share the wanted key, so the value is quickly selected among them. Equal lengths share a
 * key, and so do those below 2 fm or above 32 km: results are the same but take longer. */
#ifndef SBLCOSIM_ORDER_STATISTICS_H
#define SBLCOSIM_ORDER_STATISTICS_H

#include <stdint.h>
#include <string.h>

#include "real.h"

/* Columns whose keys are compared at once: 32 bytes of keys if the processor supports it. */
#define COLUMNS (LANES < 4 ? 4 * LANES : 16)
#define TOGETHER 4 /* percentages at a time */
#define KEY_BITS 15
#define FRACTION_BITS 8 /* of these: 256 keys to an octave, 128 octaves */
#define LEAST 0x1p-98   /* squares with the first and the last key [m2] */
#define MOST 0x1.ffp29

typedef int16_t keys __attribute__((vector_size(2 * COLUMNS)));
typedef int32_t counts __attribute__((vector_size(4 * COLUMNS)));

/* Keys of a row of squares. */
static inline keys keys_of(const double *squares)
{
    const real least = r_set1(LEAST), most = r_set1(MOST);
    const bits64 first = r_bits(least) >> (52 - FRACTION_BITS);
    int16_t row[COLUMNS];
    keys result;
    for (int j = 0; j < COLUMNS; j += LANES) {
        const real square = r_fmin(r_fmax(r_load(squares + j), least), most);
        const bits64 key = (r_bits(square) >> (52 - FRACTION_BITS)) - first;
#if LANES == 1
        row[j] = (int16_t)key;
#else
        typedef int16_t narrow __attribute__((vector_size(2 * LANES)));
        const narrow narrowed = __builtin_convertvector(key, narrow);
        memcpy(row + j, &narrowed, sizeof narrowed);
#endif
    }
    memcpy(&result, row, sizeof result);
    return result;
}

/* Number of rows whose key is below each limit, by column. */
static void count_below(const keys *rows, int64_t n, const keys limits[TOGETHER],
                        counts below[TOGETHER])
{
    memset(below, 0, TOGETHER * sizeof *below);
    for (int64_t part; n > 0; rows += part, n -= part) {
        part = n < INT16_MAX ? n : INT16_MAX;
        keys a = {0}, b = {0}, c = {0}, d = {0};
        for (int64_t i = 0; i < part; i++) { /* true is -1 */
            a -= rows[i] < limits[0];
            b -= rows[i] < limits[1];
            c -= rows[i] < limits[2];
            d -= rows[i] < limits[3];
        }
        below[0] += __builtin_convertvector(a, counts);
        below[1] += __builtin_convertvector(b, counts);
        below[2] += __builtin_convertvector(c, counts);
        below[3] += __builtin_convertvector(d, counts);
    }
}

/* The value that would have index rank after sorting (Hoare's FIND). Changes the order. */
static double select_value(double *values, int64_t n, int64_t rank)
{
    int64_t low = 0, high = n - 1;
    while (low < high) {
        const double pivot = values[low + (high - low) / 2];
        int64_t i = low, j = high;
        while (i <= j) {
            while (values[i] < pivot)
                i++;
            while (pivot < values[j])
                j--;
            if (i <= j) {
                const double swapped = values[i];
                values[i++] = values[j];
                values[j--] = swapped;
            }
        }
        if (rank <= j)
            high = j;
        else if (rank >= i)
            low = i;
        else
            break;
    }
    return values[rank];
}

/* Order statistics of COLUMNS columns.
 *
 * squares: n rows, each `width` doubles after the one before; infinite where a column has no value.
 * count: number of values by column. percentages: TOGETHER of them. rows: space for n keys.
 * candidates: space for COLUMNS * n doubles. order[p]: the square roots of the results, NaN without
 * any value. */
static void order_statistics(const double *squares, int64_t n, int width, const int64_t *count,
                             const int32_t percentages[TOGETHER], keys *rows, double *candidates,
                             double order[TOGETHER][COLUMNS])
{
    enum { WORD = sizeof(uint64_t) / sizeof(int16_t) }; /* columns looked at together */
    counts rank[TOGETHER], smaller[TOGETHER] = {{0}}, below[TOGETHER];
    keys found[TOGETHER] = {{0}}, tried[TOGETHER];
    for (int64_t i = 0; i < n; i++)
        rows[i] = keys_of(squares + i * width);
    for (int p = 0; p < TOGETHER; p++)
        for (int j = 0; j < COLUMNS; j++) /* as definitions.py */
            rank[p][j] = (int32_t)((count[j] * percentages[p] + 99) / 100) - 1;
    for (int16_t bit = 1 << (KEY_BITS - 1); bit; bit >>= 1) {
        for (int p = 0; p < TOGETHER; p++)
            tried[p] = found[p] | bit;
        count_below(rows, n, tried, below);
        for (int p = 0; p < TOGETHER; p++) {
            const counts has = below[p] <= rank[p];
            found[p] |= __builtin_convertvector(has, keys) & bit;
            smaller[p] = (below[p] & has) | (smaller[p] & ~has);
        }
    }
    for (int p = 0; p < TOGETHER; p++) {
        int64_t sharing[COLUMNS] = {0};
        for (int64_t i = 0; i < n; i++) {
            const keys equal = rows[i] == found[p];
            uint64_t words[COLUMNS / WORD];
            memcpy(words, &equal, sizeof words);
            for (int k = 0; k < COLUMNS; k += WORD)
                for (int j = k; words[k / WORD] && j < k + WORD; j++)
                    if (equal[j])
                        candidates[j * n + sharing[j]++] = squares[i * width + j];
        }
        for (int j = 0; j < COLUMNS; j++)
            order[p][j] = count[j] ? __builtin_sqrt(select_value(candidates + j * n, sharing[j],
                                                                 rank[p][j] - smaller[p][j]))
                                   : __builtin_nan("");
    }
}

#endif
