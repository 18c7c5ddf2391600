/* hang() never returns. Before that it leaves a file `hangs` beside the library, with the number of
 * its process: time limits begin then in tests with the fixture `only_hangs_take_time`.
 * To be included first. */
#ifndef _GNU_SOURCE
#define _GNU_SOURCE
#endif
#include <dlfcn.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

static inline _Noreturn void hang(void)
{
    static const char here;
    Dl_info info;
    char path[4096];
    if (dladdr(&here, &info)) {
        snprintf(path, sizeof path, "%s", info.dli_fname);
        char *const slash = strrchr(path, '/');
        snprintf(slash ? slash : path, sizeof path - (size_t)(slash ? slash - path : 0), "/hangs");
        FILE *const file = fopen(path, "w");
        if (file) {
            fprintf(file, "%d", (int)getpid());
            fclose(file);
        }
    }
    for (;;)
        sleep(1);
}
