// What pages are shown of a seat, made once for all of them.
#include "base/check.h"
#include "base/clock.h"
#include "hub/viewer.h"
#include "hub/warning.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define PLACE_NS NS_PER_S
#define METRICS_NS (2 * NS_PER_S)

// ---- moments ------------------------------------------------------------------------------------

static void take(struct audience *a, int seat, int64_t now_ns) {
    struct shown *s = &a->shown[seat];
    struct seat *from = &a->hub->seats[seat];
    pthread_mutex_lock(&a->hub->card_lock);
    newest_take(from->moment_news, &from->moment);
    s->moment = from->moment;
    s->about = from->card.about;
    s->connected = from->card.connected;
    pthread_mutex_unlock(&a->hub->card_lock);
    s->taken_ns = now_ns;
}

static void encode(struct audience *a, int seat) {
    struct shown *s = &a->shown[seat];
    a->item = (arthron_Live){.which_message = arthron_Live_moment_tag};
    moment_to_wire(&s->moment, (uint32_t)seat, &a->item.message.moment);
    enum result result = live_encode(&a->item, s->item, sizeof s->item, &s->item_size);
    CHECK(result == RESULT_OK);
    s->item_session = s->moment.session;
    s->item_step = s->moment.step;
}

void shown_refresh(struct audience *a, int seat, int64_t now_ns, int64_t age_ns) {
    struct shown *s = &a->shown[seat];
    if (s->taken_ns && now_ns - s->taken_ns < age_ns)
        return;
    take(a, seat, now_ns);
    if (s->moment.step && (s->moment.session != s->item_session || s->moment.step != s->item_step))
        encode(a, seat);
}

// ---- places -------------------------------------------------------------------------------------

// How much a counter went on; one that begins anew went on by all of it.
static uint64_t rise(uint64_t now, uint64_t *before) {
    uint64_t by = now < *before ? now : now - *before;
    *before = now;
    return by;
}

static void tell_devices(struct shown *s, const struct seat_counts *counts, const struct card *card,
                         double passed_s, arthron_Place *out) {
    out->devices_count = (pb_size_t)card->device_count;
    for (int i = 0; i < card->device_count; i++) {
        const struct device_counts *c = &counts->devices[i];
        arthron_DeviceRate *d = &out->devices[i];
        double samples = (double)rise(atomic_load(&c->samples), &s->samples[i]);
        snprintf(d->name, sizeof d->name, "%s", card->devices[i].name);
        snprintf(d->driver, sizeof d->driver, "%s", card->devices[i].driver);
        d->rate_hz = (float)(samples / passed_s);
        d->dropouts = (uint32_t)atomic_load(&c->dropouts);
        d->lost = atomic_load(&c->lost);
    }
}

static void tell_tissues(const struct hub *hub, const struct card *card, arthron_Place *out) {
    int count = scene_tissue_count(hub->scenes[card->scene]);
    for (int i = 0; i < count; i++) {
        out->cuts += card->tissues[i].cuts;
        out->removed_mm3 += card->tissues[i].removed_mm3 + card->tissues[i].pieces_mm3;
    }
}

static float strength_of(const struct hub *hub, const struct card *card, bool has_session) {
    if (has_session)
        return (float)card->about.strength;
    return (float)(isnan(card->strength) ? hub->config.settings.field.strength : card->strength);
}

// passed_s: since the one before; INFINITY where nobody looked for long: of that nothing is told.
static void fill_place(struct audience *a, int seat, double passed_s, arthron_Place *out) {
    struct hub *hub = a->hub;
    struct shown *s = &a->shown[seat];
    struct seat_counts *counts = &hub->seats[seat].counts;
    pthread_mutex_lock(&hub->card_lock);
    struct card card = hub->seats[seat].card;
    pthread_mutex_unlock(&hub->card_lock);
    bool has_session = seat_has_session(&hub->seats[seat]);
    *out = (arthron_Place){.seat = (uint32_t)seat, .has_info = true};
    seat_info(hub, seat, &out->info);
    memcpy(out->trainee, has_session ? card.about.trainee : card.trainee, sizeof out->trainee);
    tell_devices(s, counts, &card, passed_s, out);
    tell_tissues(hub, &card, out);
    double lost = (double)rise(out->info.frames_lost, &s->lost);
    double steps = (double)rise(out->info.steps, &s->frames);
    double warp_mm = (double)atomic_exchange(&counts->warp_nm, 0) / 1e6;
    if (isfinite(passed_s)) {
        out->warp_mm = (float)warp_mm;
        out->loss_share = (float)(lost / fmax(lost + steps, 1));
    }
    out->strength = strength_of(hub, &card, has_session);
    warning_of_place(out, hub->config.calibration_mm);
}

void shown_place(struct audience *a, int seat, int64_t now_ns) {
    struct shown *s = &a->shown[seat];
    int state = atomic_load(&a->hub->seats[seat].counts.state);
    bool changed = state != s->place_state || s->connected != s->place_connected;
    if (s->place_number && !changed && now_ns - s->place_ns < PLACE_NS)
        return;
    double passed_s = fmax((double)(now_ns - s->place_ns) / NS_PER_S, 0.01);
    if (!s->place_number || now_ns - s->place_ns > 2 * PLACE_NS)
        passed_s = INFINITY;
    a->item = (arthron_Live){.which_message = arthron_Live_place_tag};
    fill_place(a, seat, passed_s, &a->item.message.place);
    enum result result = live_encode(&a->item, s->place, sizeof s->place, &s->place_size);
    CHECK(result == RESULT_OK);
    s->place_number++;
    s->place_ns = now_ns;
    s->place_state = state;
    s->place_connected = s->connected;
}

// ---- metrics ------------------------------------------------------------------------------------

void shown_metrics(struct audience *a, int seat, int64_t now_ns) {
    struct shown *s = &a->shown[seat];
    if (s->metrics_ns && now_ns - s->metrics_ns < METRICS_NS)
        return;
    if (!s->metrics)
        s->metrics = alloc(1, LIVE_ITEM_MAX);
    a->item = (arthron_Live){.which_message = arthron_Live_metrics_tag};
    s->metrics_of = s->about.session;
    desk_metrics(a->hub, a->hub->seats[seat].station->name, &a->item.message.metrics);
    enum result result = live_encode(&a->item, s->metrics, LIVE_ITEM_MAX, &s->metrics_size);
    CHECK(result == RESULT_OK);
    s->metrics_ns = now_ns;
}
