#include "base/thread.h"

#include <linux/sched.h>
#include <linux/sched/types.h>
#include <sys/resource.h>
#include <sys/syscall.h>
#include <unistd.h>

#define SLICE_NS 100000
#define NICENESS 10

void thread_wakes_at_once(void) {
    struct sched_attr attributes = {
        .size = sizeof attributes, .sched_policy = SCHED_NORMAL, .sched_runtime = SLICE_NS};
    syscall(SYS_sched_setattr, 0, &attributes, 0);
}

void thread_works_beside(void) {
    setpriority(PRIO_PROCESS, (id_t)gettid(), NICENESS);
}
