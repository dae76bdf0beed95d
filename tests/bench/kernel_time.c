#include "kernel_time.h"

#include "cut/cut.h"
#include "match/conform.h"

#include <time.h>

static _Thread_local struct kernel_time kernels;

double thread_ms(void) {
    struct timespec now;
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
    return 1e3 * (double)now.tv_sec + 1e-6 * (double)now.tv_nsec;
}

struct kernel_time kernel_time_of_thread(void) {
    return kernels;
}

enum cut_outcome __real_cut_apply(struct cut_mesh *mesh, const struct convex *parts, int part_count,
                                  struct cut_change *out_change, struct error *err);
enum cut_outcome __wrap_cut_apply(struct cut_mesh *mesh, const struct convex *parts, int part_count,
                                  struct cut_change *out_change, struct error *err);
void __real_conform_to(struct conform *conform, const struct conform_target *target,
                       struct conform_report *out_report);
void __wrap_conform_to(struct conform *conform, const struct conform_target *target,
                       struct conform_report *out_report);

enum cut_outcome __wrap_cut_apply(struct cut_mesh *mesh, const struct convex *parts, int part_count,
                                  struct cut_change *out_change, struct error *err) {
    double begin = thread_ms();
    enum cut_outcome outcome = __real_cut_apply(mesh, parts, part_count, out_change, err);
    kernels.cut_ms += thread_ms() - begin;
    kernels.cuts++;
    return outcome;
}

void __wrap_conform_to(struct conform *conform, const struct conform_target *target,
                       struct conform_report *out_report) {
    double begin = thread_ms();
    __real_conform_to(conform, target, out_report);
    kernels.fit_ms += thread_ms() - begin;
    kernels.fits++;
}
