// The messages about a station that are the same for all pages, so made once.
#include "base/check.h"
#include "base/clock.h"
#include "live/viewer.h"
#include "live/warning.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define PLACE_NS NS_PER_S
#define REFUSED_TOLD_NS (15 * NS_PER_S) // a station tries again each 5 s
#define METRICS_NS (2 * NS_PER_S)

// ---- moments ------------------------------------------------------------------------------------

static void take_snapshot(struct live_server *live, int station, int64_t now_ns) {
    struct station_cache *s = &live->cache[station];
    struct station_status status;
    sessions_status(live->sessions, station, &status);
    runtime_snapshot(sessions_runtime(live->sessions), station, &s->moment);
    runtime_shown_attempt(sessions_runtime(live->sessions), station, &s->attempt);
    s->about = status.about;
    s->connected = status.connected;
    s->state = status.state;
    s->taken_ns = now_ns;
}

static void encode(struct live_server *live, int station) {
    struct station_cache *s = &live->cache[station];
    live->item = (arthron_Live){.which_message = arthron_Live_moment_tag};
    snapshot_to_wire(&s->moment, (uint32_t)station, &live->item.message.moment);
    enum result result = live_encode(&live->item, s->item, sizeof s->item, &s->item_size);
    CHECK(result == RESULT_OK);
    s->item_session = s->moment.session;
    s->item_step = s->moment.step;
}

void cache_refresh(struct live_server *live, int station, int64_t now_ns, int64_t age_ns) {
    struct station_cache *s = &live->cache[station];
    if (s->taken_ns && now_ns - s->taken_ns < age_ns)
        return;
    take_snapshot(live, station, now_ns);
    if (s->moment.step && (s->moment.session != s->item_session || s->moment.step != s->item_step))
        encode(live, station);
}

// ---- places -------------------------------------------------------------------------------------

// How much a counter went on; one that begins anew went on by all of it.
static uint64_t rise(uint64_t now, uint64_t *before) {
    uint64_t by = now < *before ? now : now - *before;
    *before = now;
    return by;
}

static void tell_devices(struct station_cache *s, const struct station_counts *counts,
                         const struct station_status *status, double passed_s, arthron_Place *out) {
    out->devices_count = (pb_size_t)status->device_count;
    for (int i = 0; i < status->device_count; i++) {
        const struct device_counts *c = &counts->devices[i];
        arthron_DeviceRate *d = &out->devices[i];
        double samples = (double)rise(atomic_load(&c->samples), &s->samples[i]);
        snprintf(d->name, sizeof d->name, "%s", status->devices[i].name);
        snprintf(d->driver, sizeof d->driver, "%s", status->devices[i].driver);
        d->rate_hz = (float)(samples / passed_s);
        d->dropouts = (uint32_t)atomic_load(&c->dropouts);
        d->lost = atomic_load(&c->lost);
    }
}

static double outer_third(const struct quality_report *report) {
    double sum = 0;
    for (int along = 0; along < ZONE_ALONG_COUNT; along++)
        sum += report->removed.mm3[along][ZONE_OUTER];
    return sum;
}

static void tell_tissues(struct live_server *live, int station, const struct station_status *status,
                         arthron_Place *out) {
    struct tissue_report report;
    runtime_tissues(sessions_runtime(live->sessions), station, &report);
    if (!status->has_tissues || report.session != status->about.serial)
        return;
    for (int i = 0; i < scene_tissue_count(sessions_scene(live->sessions, status->scene)); i++) {
        out->cuts += report.figures[i].cuts;
        out->removed_mm3 += report.figures[i].quality.removed_mm3;
        out->planned_mm3 += report.figures[i].quality.planned_mm3;
        out->over_mm3 += report.figures[i].quality.over_mm3;
        out->outer_mm3 += outer_third(&report.figures[i].quality);
    }
}

static float strength_of(const struct sessions_config *config,
                         const struct station_status *status) {
    if (status->phase != SLOT_EMPTY && status->about.serial)
        return (float)status->about.strength;
    return (float)(isnan(status->strength) ? config->settings.field.strength : status->strength);
}

// passed_s: since the one before; INFINITY where nobody looked for long: nothing is told of that.
static void fill_place(struct live_server *live, int station, double passed_s, arthron_Place *out) {
    const struct sessions_config *config = sessions_config(live->sessions);
    struct runtime *runtime = sessions_runtime(live->sessions);
    struct station_cache *s = &live->cache[station];
    struct station_status status;
    sessions_status(live->sessions, station, &status);
    bool has_session = status.phase != SLOT_EMPTY;
    *out = (arthron_Place){.station_number = (uint32_t)station, .has_info = true};
    sessions_info(live->sessions, station, &out->info);
    memcpy(out->trainee, has_session ? status.about.trainee : status.trainee, sizeof out->trainee);
    if (clock_now_ns() - status.refused_ns < REFUSED_TOLD_NS)
        snprintf(out->refused, sizeof out->refused, "%s", status.refused);
    tell_devices(s, runtime_counts(runtime, station), &status, passed_s, out);
    tell_tissues(live, station, &status, out);
    out->help_asked = has_session && status.help_of == status.about.serial;
    double lost = (double)rise(out->info.frames_lost, &s->lost);
    double late = (double)rise(out->info.frames_late, &s->late);
    double steps = (double)rise(out->info.steps, &s->frames);
    double warp_mm = runtime_take_warp_mm(runtime, station);
    double pause_ns = (double)runtime_take_pause_ns(runtime, station, clock_now_ns());
    if (isfinite(passed_s)) {
        out->warp_mm = (float)warp_mm;
        out->loss_share = (float)(lost / fmax(lost + steps, 1));
        out->late_share = (float)(late / fmax(late + steps, 1));
        out->pause_s = (float)(out->info.connected && has_session ? pause_ns / 1e9 : 0);
    }
    out->strength = strength_of(config, &status);
    out->optic_deg = (float)config->stations[station].optic.tilt_deg;
    out->optic_view_deg = (float)config->stations[station].optic.field_deg;
    if (live->servers.served_by[station] == SERVED_HERE)
        snprintf(out->server, sizeof out->server, "%s", config->cluster.jet.name);
    warning_of_place(out, config->calibration_mm);
}

void cache_place(struct live_server *live, int station, int64_t now_ns) {
    struct station_cache *s = &live->cache[station];
    int state = s->state;
    bool changed = state != s->place_state || s->connected != s->place_connected;
    if (s->place_number && !changed && now_ns - s->place_ns < PLACE_NS)
        return;
    double passed_s = fmax((double)(now_ns - s->place_ns) / NS_PER_S, 0.01);
    if (!s->place_number || now_ns - s->place_ns > 2 * PLACE_NS)
        passed_s = INFINITY;
    live->item = (arthron_Live){.which_message = arthron_Live_place_tag};
    fill_place(live, station, passed_s, &live->item.message.place);
    arthron_Place *place = &live->item.message.place;
    enum result result = live_encode(&live->item, s->place, sizeof s->place, &s->place_size);
    CHECK(result == RESULT_OK);
    memcpy(s->trainee, place->trainee, sizeof s->trainee);
    memcpy(s->next_trainee, place->info.next_trainee, sizeof s->next_trainee);
    place->trainee[0] = place->info.trainee[0] = place->info.next_trainee[0] = '\0';
    result = live_encode(&live->item, s->nameless, sizeof s->nameless, &s->nameless_size);
    CHECK(result == RESULT_OK);
    s->place_number++;
    s->place_ns = now_ns;
    s->place_state = state;
    s->place_connected = s->connected;
}

// ---- metrics ------------------------------------------------------------------------------------

// The session may have changed since the moment was taken: then what is cached stays.
void cache_metrics(struct live_server *live, int station, int64_t now_ns) {
    struct station_cache *s = &live->cache[station];
    if (s->metrics_of == s->about.serial && now_ns - s->metrics_ns < METRICS_NS)
        return;
    live->item = (arthron_Live){.which_message = arthron_Live_metrics_tag};
    if (!sessions_metrics_of(live->sessions, station, s->about.serial, &live->item.message.metrics))
        return;
    if (!s->metrics)
        s->metrics = alloc(1, LIVE_ITEM_MAX);
    enum result result = live_encode(&live->item, s->metrics, LIVE_ITEM_MAX, &s->metrics_size);
    CHECK(result == RESULT_OK);
    s->metrics_of = s->about.serial;
    s->metrics_ns = now_ns;
}
