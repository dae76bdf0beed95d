// What a live session is worth so far: from its worker to whoever asks.
#include "base/check.h"
#include "hub/reply.h"
#include "hub/seat.h"

#include <stdlib.h>
#include <string.h>

void tally_begin(const struct trace_header *header, const struct scene *scene,
                 struct tally *out_tally) {
    memcpy(out_tally->session_id, header->session_id, sizeof out_tally->session_id);
    out_tally->scene = scene;
    metrics_init(&out_tally->metrics, header->optic);
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
