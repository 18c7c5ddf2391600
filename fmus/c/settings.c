/* Start values of all components from the keys of a scenario, as a plain function: a shared library,
 * or a module of WebAssembly without imports. The README of this folder says how to call it. */
#include "real.h"
#if defined(__wasm__)
#define EXPORTED(name) __attribute__((export_name(#name)))
#elif defined(_WIN32)
#define EXPORTED(name) __declspec(dllexport)
#else
#define EXPORTED(name) __attribute__((visibility("default")))
#endif

#include "start_values.h" /* generated */

EXPORTED(sblcosim_keys) int32_t sblcosim_keys(void);
int32_t sblcosim_keys(void) { return N_KEYS; }

EXPORTED(sblcosim_start_values) int32_t sblcosim_start_values(const double *keys, double *values);
int32_t sblcosim_start_values(const double *keys, double *values)
{
    start_values(keys, values);
    return N_VALUES;
}
