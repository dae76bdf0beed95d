#include "hub/seat.h"

#include "base/clock.h"
#include "hub/grades.h"

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

void seat_info(struct hub *hub, int index, arthron_SessionInfo *out) {
    struct seat *seat = &hub->seats[index];
    pthread_mutex_lock(&hub->card_lock);
    struct card card = seat->card;
    pthread_mutex_unlock(&hub->card_lock);
    const struct seat_counts *counts = &seat->counts;
    memset(out, 0, sizeof *out);
    snprintf(out->station, sizeof out->station, "%s", seat->station->name);
    snprintf(out->case_name, sizeof out->case_name, "%s", hub->config.cases[card.scene].name);
    snprintf(out->case_grade, sizeof out->case_grade, "%s", grades_name(hub->grades, card.scene));
    out->connected = card.connected;
    out->state = (arthron_SessionState)atomic_load(&counts->state);
    memcpy(out->id, card.session_id, sizeof out->id);
    out->start_utc_ns = card.start_utc_ns;
    snprintf(out->trace, sizeof out->trace, "%s", card.trace);
    snprintf(out->trainee, sizeof out->trainee, "%s", card.about.trainee);
    snprintf(out->next_trainee, sizeof out->next_trainee, "%s", card.trainee);
    out->steps = atomic_load(&counts->steps);
    out->frames_lost = atomic_load(&counts->frames_lost);
    out->frames_old = atomic_load(&counts->frames_old);
    out->frames_early = atomic_load(&counts->frames_early);
    out->frames_invalid = atomic_load(&counts->frames_invalid);
    out->rtt_p50_us = (double)atomic_load(&counts->rtt_ns) / 1e3;
    out->trace_missing = atomic_load(&counts->trace_missing);
    out->trace_failing = atomic_load(&counts->trace_failing);
    out->touches = atomic_load(&counts->touches);
    out->drift_mm = (double)atomic_load(&counts->drift_nm) / 1e6;
    out->has_calibration = card.calibrated;
    out->calibration = card.calibration;
    if (card.calibrated)
        calibration_judge(&card.calibration, &hub->config, clock_utc_ns() / NS_PER_S,
                          out->calibration_problem, sizeof out->calibration_problem);
    if (card.connected)
        out->certificate_until_utc_s = control_certificate_end(hub->control, card.peer);
    out->clock_uncertainty_us = (double)atomic_load(&counts->clock_uncertainty_ns) / 1e3;
}

void hub_ring(void *user) {
    struct hub *hub = user;
    pthread_rwlock_rdlock(&hub->bell_lock);
    if (hub->bell)
        hub->bell(hub->bell_user);
    pthread_rwlock_unlock(&hub->bell_lock);
}
