// What a live session is worth so far: from its worker to whoever asks.
#include "base/check.h"
#include "base/clock.h"
#include "hub/reply.h"
#include "hub/seat.h"

#include <stdlib.h>
#include <string.h>

#define TALLY_NS (NS_PER_S / 4)

void tally_begin(const struct trace_header *header, const struct scene *scene,
                 struct tally *out_tally) {
    memcpy(out_tally->session_id, header->session_id, sizeof out_tally->session_id);
    out_tally->scene = scene;
    metrics_init(&out_tally->metrics, header->optic);
}

// Left now and then, and whenever the session begins, rests or ends, or a cut lands.
void tally_step(struct seat *seat, const struct session_input *input,
                const struct session_output *output) {
    struct tally *tally = &seat->live->tally;
    bool matters = output->events & EVENT_STATE || output->landed.job;
    metrics_step(&tally->metrics, input, output);
    if (!matters && output->time_ns - seat->tally_ns < TALLY_NS)
        return;
    newest_put(seat->tallies, tally);
    seat->tally_ns = output->time_ns;
}

bool desk_metrics(void *user, const char *station, arthron_Metrics *out) {
    struct hub *hub = user;
    int index = hub_find_station(&hub->config, station);
    out->metrics_count = 0;
    if (index < 0)
        return false;
    struct seat *seat = &hub->seats[index];
    struct tally *tally = alloc(1, sizeof *tally);
    pthread_mutex_lock(&hub->card_lock);
    newest_take(seat->tallies, &seat->tally);
    *tally = seat->tally;
    bool is_its = !memcmp(tally->session_id, seat->card.session_id, sizeof tally->session_id);
    pthread_mutex_unlock(&hub->card_lock);
    if (is_its && tally->scene)
        reply_metrics(&tally->metrics, scene_case(tally->scene), out);
    free(tally);
    return true;
}
