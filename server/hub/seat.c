#include "hub/seat.h"

#include <stdio.h>
#include <string.h>

void seat_moment(struct hub *hub, int index, struct moment *out) {
    struct seat *seat = &hub->seats[index];
    pthread_mutex_lock(&hub->card_lock);
    newest_take(seat->moment_news, &seat->moment);
    *out = seat->moment;
    pthread_mutex_unlock(&hub->card_lock);
}

void seat_introduce(struct hub *hub, int index, const struct live *live,
                    const struct trace_header *header, struct remarks *said) {
    struct card *card = &hub->seats[index].card;
    pthread_mutex_lock(&hub->card_lock);
    card->about = (struct about){
        .session = live->serial,
        .scene = card->scene,
        .start_utc_ns = header->start_utc_ns,
        .start_ns = header->start_ns,
        .strength = header->settings.field.strength,
    };
    memcpy(card->about.id, header->session_id, sizeof card->about.id);
    snprintf(card->about.trainee, sizeof card->about.trainee, "%s", header->trainee);
    remarks_begin(&hub->seats[index].remarks, live->serial, said);
    pthread_mutex_unlock(&hub->card_lock);
}
