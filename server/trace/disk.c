#include "trace/disk.h"

#include "base/check.h"
#include "base/clock.h"
#include "base/log.h"

#include <errno.h>
#include <signal.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#define WRITE_EVERY_NS (20 * NS_PER_MS)
#define LOOK_EVERY_NS (100 * NS_PER_MS)
#define SYNC_EVERY_NS NS_PER_S
#define SYNC_BYTES ((uint64_t)1 << 20) // so much is not left to wait for a second
#define LAST_PATIENCE_NS (2 * NS_PER_S)

// The threads run while there are writers.
static struct {
    pthread_mutex_t changing; // of who begins and ends writers
    pthread_mutex_t lock;     // of all below
    pthread_cond_t tick, look, released;
    struct trace_writer **writers;
    int count;
    bool stop;
    pthread_t writing, syncing;
} disk = {.changing = PTHREAD_MUTEX_INITIALIZER, .lock = PTHREAD_MUTEX_INITIALIZER};

// ---- one writer ---------------------------------------------------------------------------------

static void failed(struct trace_writer *w, const char *what) {
    atomic_store(&w->failed_head, buffer_head(&w->buffer));
    if (!atomic_exchange(&w->failing, true))
        log_error("trace", "%s: %s: %s; trying again", w->path, what, strerror(errno));
}

// What the tap was not told yet stays.
static void release_before(struct trace_writer *w, uint64_t position) {
    buffer_release(&w->buffer, w->tap && w->tapped < position ? w->tapped : position);
}

// A disk that takes its time is no reason to drop steps: rather it gets what was written only once.
static void make_room(struct trace_writer *w) {
    uint64_t head = buffer_head(&w->buffer), written = atomic_load(&w->written);
    if (head - w->buffer.kept > BUFFER_SIZE / 4 * 3)
        release_before(w, written < head - BUFFER_SIZE / 2 ? written : head - BUFFER_SIZE / 2);
}

// A write that fails leaves its bytes in the buffer, so the file stays a whole stream.
static void write_out_locked(struct trace_writer *w) {
    if (atomic_load(&w->rewrite)) {
        uint64_t synced = atomic_load(&w->synced), kept = w->buffer.kept;
        atomic_store(&w->written, synced > kept ? synced : kept);
        atomic_store(&w->rewrite, false);
    }
    writer_seal(w);
    uint64_t at = atomic_load(&w->written);
    while (at != w->sealed) {
        const uint8_t *data;
        size_t size = buffer_span(&w->buffer, at, &data);
        if (size > w->sealed - at)
            size = (size_t)(w->sealed - at);
        ssize_t done = pwrite(w->fd, data, size, (off_t)(w->offset + at));
        if (done < 0 && errno == EINTR)
            continue;
        if (done <= 0) {
            failed(w, "cannot write");
            break;
        }
        at += (uint64_t)done;
        atomic_store(&w->written, at);
        writer_tap(w);
        make_room(w);
    }
}

static void write_out(struct trace_writer *w) {
    pthread_mutex_lock(&w->writing);
    write_out_locked(w);
    pthread_mutex_unlock(&w->writing);
}

static void put_on_disk(struct trace_writer *w) {
    uint64_t written = atomic_load(&w->written);
    w->synced_ns = clock_now_ns();
    if (atomic_load(&w->rewrite) || written == atomic_load(&w->synced))
        return;
    if (fdatasync(w->fd) != 0) {
        failed(w, "cannot put on disk");
        atomic_store(&w->fault_utc_ns, clock_utc_ns());
        atomic_fetch_add(&w->faults, 1);
        atomic_store(&w->rewrite, true);
        return;
    }
    pthread_mutex_lock(&w->writing);
    atomic_store(&w->synced, written);
    release_before(w, written);
    pthread_mutex_unlock(&w->writing);
    if (written >= atomic_load(&w->failed_head) && atomic_exchange(&w->failing, false))
        log_warning("trace", "%s: the disk can be written again", w->path);
}

static uint64_t not_on_disk(const struct trace_writer *w) {
    return buffer_head(&w->buffer) - atomic_load(&w->synced);
}

// False: the disk fails, and may work again soon. What failed for so long is lost.
static bool finish(struct trace_writer *w) {
    int64_t now_ns = clock_now_ns();
    if (!w->finish_ns)
        w->finish_ns = now_ns;
    bool is_last = now_ns - w->finish_ns >= LAST_PATIENCE_NS;
    write_out(w);
    put_on_disk(w);
    if (!w->leaves && !w->end_put && (is_last || !not_on_disk(w))) {
        writer_put_end(w);
        w->end_put = true;
        write_out(w);
        put_on_disk(w);
    }
    if (not_on_disk(w) && is_last)
        log_error("trace", "%s: its last %llu bytes are lost because the disk is full or fails",
                  w->path, (unsigned long long)not_on_disk(w));
    return is_last || !not_on_disk(w);
}

// True: it was finished.
static bool sync_or_finish(struct trace_writer *w, bool ends) {
    uint64_t waits = atomic_load(&w->written) - atomic_load(&w->synced);
    if (ends)
        return finish(w);
    if (waits >= SYNC_BYTES || clock_now_ns() - w->synced_ns >= SYNC_EVERY_NS)
        put_on_disk(w);
    return false;
}

// ---- all of them --------------------------------------------------------------------------------

// The next one that is there, held until it was seen to, from *at on; or NULL. While the lock is
// not held, the list may change, so that a writer is passed over or seen twice in a round.
static struct trace_writer *hold_next(int *at) {
    while (*at < disk.count) {
        struct trace_writer *w = disk.writers[(*at)++];
        if (!w->ended) {
            w->holds++;
            return w;
        }
    }
    return NULL;
}

// A round has many writers, most of them of sessions that rest.
static bool has_news(const struct trace_writer *w) {
    return atomic_load(&w->rewrite) || atomic_load(&w->written) != buffer_head(&w->buffer);
}

static struct trace_writer *hold_next_with_news(int *at) {
    while (*at < disk.count && !has_news(disk.writers[*at]))
        ++*at;
    return hold_next(at);
}

static bool has_to_sync(const struct trace_writer *w) {
    return w->ends || atomic_load(&w->written) != atomic_load(&w->synced);
}

static struct trace_writer *hold_next_to_sync(int *at) {
    while (*at < disk.count && !has_to_sync(disk.writers[*at]))
        ++*at;
    return hold_next(at);
}

static void let_go(struct trace_writer *w) {
    w->holds--;
    pthread_cond_broadcast(&disk.released);
}

static void wait_for(pthread_cond_t *condition, int64_t for_ns) {
    int64_t when_ns = clock_now_ns() + for_ns;
    struct timespec when = {when_ns / NS_PER_S, when_ns % NS_PER_S};
    pthread_cond_timedwait(condition, &disk.lock, &when);
}

static void *run_disk(void *context) {
    (void)context;
    pthread_mutex_lock(&disk.lock);
    while (!disk.stop) {
        struct trace_writer *w;
        bool hurry = false;
        for (int at = 0; (w = hold_next_with_news(&at));) {
            pthread_mutex_unlock(&disk.lock);
            write_out(w);
            buffer_touch_ahead(&w->buffer);
            hurry |= not_on_disk(w) >= SYNC_BYTES;
            pthread_mutex_lock(&disk.lock);
            let_go(w);
        }
        if (hurry)
            pthread_cond_signal(&disk.look);
        if (!disk.stop)
            wait_for(&disk.tick, WRITE_EVERY_NS);
    }
    pthread_mutex_unlock(&disk.lock);
    return NULL;
}

static void *sync_all(void *context) {
    (void)context;
    pthread_mutex_lock(&disk.lock);
    while (!disk.stop) {
        struct trace_writer *w;
        for (int at = 0; (w = hold_next_to_sync(&at));) {
            bool ends = w->ends;
            pthread_mutex_unlock(&disk.lock);
            bool finished = sync_or_finish(w, ends);
            pthread_mutex_lock(&disk.lock);
            w->ended |= finished;
            let_go(w);
        }
        bool more = false;
        for (int i = 0; i < disk.count; i++)
            more |= disk.writers[i]->ends && !disk.writers[i]->finish_ns;
        if (!disk.stop && !more)
            wait_for(&disk.look, LOOK_EVERY_NS);
    }
    pthread_mutex_unlock(&disk.lock);
    return NULL;
}

static void init_condition(pthread_cond_t *condition) {
    pthread_condattr_t monotonic;
    pthread_condattr_init(&monotonic);
    pthread_condattr_setclock(&monotonic, CLOCK_MONOTONIC);
    pthread_cond_init(condition, &monotonic);
    pthread_condattr_destroy(&monotonic);
}

static void stop_threads(bool writes, bool syncs) {
    pthread_mutex_lock(&disk.lock);
    disk.stop = true;
    pthread_cond_signal(&disk.tick);
    pthread_cond_signal(&disk.look);
    pthread_mutex_unlock(&disk.lock);
    if (writes)
        pthread_join(disk.writing, NULL);
    if (syncs)
        pthread_join(disk.syncing, NULL);
    pthread_cond_destroy(&disk.tick);
    pthread_cond_destroy(&disk.look);
    pthread_cond_destroy(&disk.released);
    free(disk.writers);
    disk.writers = NULL;
}

// Signals are for the program's other threads; a file size limit then is an error like a full disk.
static bool start_threads(void) {
    init_condition(&disk.tick);
    init_condition(&disk.look);
    init_condition(&disk.released);
    disk.stop = false;
    sigset_t all, before;
    sigfillset(&all);
    pthread_sigmask(SIG_SETMASK, &all, &before);
    bool writes = pthread_create(&disk.writing, NULL, run_disk, NULL) == 0;
    bool syncs = writes && pthread_create(&disk.syncing, NULL, sync_all, NULL) == 0;
    pthread_sigmask(SIG_SETMASK, &before, NULL);
    if (!syncs)
        stop_threads(writes, false);
    return syncs;
}

bool disk_begin(struct trace_writer *w) {
    pthread_mutex_lock(&disk.changing);
    bool runs = disk.count > 0 || start_threads();
    if (runs) {
        pthread_mutex_lock(&disk.lock);
        disk.writers = alloc_resize(disk.writers, (size_t)disk.count + 1, sizeof *disk.writers);
        disk.writers[disk.count++] = w;
        pthread_mutex_unlock(&disk.lock);
    }
    pthread_mutex_unlock(&disk.changing);
    return runs;
}

static void forget(struct trace_writer *w) {
    int i = 0;
    while (disk.writers[i] != w)
        i++;
    disk.count--;
    memmove(&disk.writers[i], &disk.writers[i + 1],
            (size_t)(disk.count - i) * sizeof *disk.writers);
}

void disk_end(struct trace_writer *w) {
    pthread_mutex_lock(&disk.lock);
    w->ends = true;
    pthread_cond_signal(&disk.look);
    while (!w->ended || w->holds)
        pthread_cond_wait(&disk.released, &disk.lock);
    pthread_mutex_unlock(&disk.lock);
    pthread_mutex_lock(&disk.changing);
    pthread_mutex_lock(&disk.lock);
    forget(w);
    bool last = disk.count == 0;
    pthread_mutex_unlock(&disk.lock);
    if (last)
        stop_threads(true, true);
    pthread_mutex_unlock(&disk.changing);
}

void disk_hurry(void) {
    pthread_mutex_lock(&disk.lock);
    pthread_cond_signal(&disk.tick);
    pthread_cond_signal(&disk.look);
    pthread_mutex_unlock(&disk.lock);
}

// ---- the program is about to end ----------------------------------------------------------------

#define LAST_LOCK_NS (200 * NS_PER_MS)
#define LAST_APPENDS_NS (2 * NS_PER_MS)

atomic_bool disk_ends;

// Who holds it may be this very thread, or one that waits for the program's end.
static bool lock_soon(pthread_mutex_t *mutex) {
    int64_t when_ns = clock_now_ns() + LAST_LOCK_NS;
    struct timespec when = {when_ns / NS_PER_S, when_ns % NS_PER_S};
    return pthread_mutex_clocklock(mutex, CLOCK_MONOTONIC, &when) == 0;
}

void trace_write_last(void) {
    atomic_store(&disk_ends, true);
    nanosleep(&(struct timespec){0, LAST_APPENDS_NS}, NULL); // those that are under way
    bool locked = lock_soon(&disk.lock);                     // else nobody changes the list
    for (int i = 0; i < disk.count; i++) {
        struct trace_writer *w = disk.writers[i];
        if (w->ended || !lock_soon(&w->writing))
            continue;
        write_out_locked(w);
        pthread_mutex_unlock(&w->writing);
    }
    if (locked)
        pthread_mutex_unlock(&disk.lock);
}
