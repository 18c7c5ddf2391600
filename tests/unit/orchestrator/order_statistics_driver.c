/* All columns of some rows through order_statistics.h, for its test. */
#include "order_statistics.h"

extern __attribute__((visibility("default"))) const int32_t columns;
const int32_t columns = COLUMNS;

__attribute__((visibility("default"))) void order(const double *squares, int64_t n,
                                                  const int64_t *count,
                                                  const int32_t *percentages, void *rows,
                                                  double *candidates, double *result)
{
    order_statistics(squares, n, COLUMNS, count, percentages, rows, candidates,
                     (double(*)[COLUMNS])result);
}
