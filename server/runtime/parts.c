#include "runtime/parts.h"

#include "base/check.h"
#include "base/clock.h"

#include <errno.h>
#include <unistd.h>

size_t worker_room(const struct runtime *runtime, int worker, size_t each, size_t least) {
    size_t room = 1, wanted = each * (size_t)worker_stations(runtime, worker);
    while (room < wanted || room < least)
        room *= 2;
    return room;
}

void wake_fd(int fd) {
    uint64_t one = 1;
    ssize_t written = write(fd, &one, sizeof one);
    CHECK(written == sizeof one || errno == EAGAIN);
}

bool worker_may_serve(const struct worker *worker) {
    const atomic_int_fast64_t *until_ns = worker->runtime->config.serve_until_ns;
    if (!until_ns)
        return true;
    int64_t before_ns = atomic_load_explicit(until_ns, memory_order_acquire);
    return clock_now_ns() < before_ns;
}

void worker_notify(struct worker *worker, const struct runtime_notice *notice) {
    bool pushed = ring_push(worker->notices, notice);
    CHECK(pushed);
    worker->runtime->config.notify(worker->runtime->config.user);
}
