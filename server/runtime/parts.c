#include "runtime/parts.h"

#include "base/check.h"

#include <errno.h>
#include <unistd.h>

void wake_fd(int fd) {
    uint64_t one = 1;
    ssize_t written = write(fd, &one, sizeof one);
    CHECK(written == sizeof one || errno == EAGAIN);
}

void worker_notify(struct worker *worker, const struct runtime_notice *notice) {
    bool pushed = ring_push(worker->notices, notice);
    CHECK(pushed);
    worker->runtime->config.notify(worker->runtime->config.user);
}
