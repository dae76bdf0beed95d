#include "runtime/capture.h"

#include "runtime/cut_worker.h"
#include "runtime/keeper.h"

#include <string.h>

void capture_begin(const struct worker *worker, struct station_runtime *station) {
    if (worker->runtime->config.keep_at_once)
        keeping_begin_at_once(&station->keeping);
    else
        keeping_begin(&station->keeping, station->session->last_ns, 0);
    atomic_store(&station->kept_bytes, 0);
}

static bool can_be_kept(const struct station_runtime *station,
                        const struct session_output *output) {
    const struct session_runtime *session = station->session;
    return session->trace_file[0] && !station->ending && output->state != SESSION_CLOSED &&
           !trace_writer_status(session->trace).missing &&
           session_can_be_kept(session->session, &output->job);
}

static bool capture(const struct session_runtime *session, const struct session_output *output,
                    uint64_t end, struct session_image *image) {
    memcpy(image->trace, session->trace_file, sizeof image->trace);
    image->state = (struct trace_state){.output_hash = output->hash};
    trace_place_behind(session->trace, end, output, &image->state.place);
    image->session.used = 0;
    image->session.bad = false;
    kept_session_write(session, &output->job, &image->session);
    return !image->session.bad;
}

void capture_step(struct worker *worker, struct station_runtime *station,
                  const struct session_output *output, uint64_t end) {
    struct session_image *image = worker->image;
    if (!keeping_is_due(&station->keeping, output) || atomic_load(&image->busy) ||
        !can_be_kept(station, output) || !capture(station->session, output, end, image))
        return;
    atomic_store(&image->busy, true);
    cut_worker_keep(worker->cut_worker, station->index, station->session->serial, image);
    keeping_begin(&station->keeping, output->time_ns, atomic_load(&station->kept_bytes));
}
