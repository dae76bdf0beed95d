#include "base/clock.h"
#include "review/survey.h"
#include "trace_commands.h"

#include <inttypes.h>
#include <jansson.h>
#include <stdio.h>
#include <string.h>
#include <time.h>

static const char info_help[] =
    "Usage: arthron-trace info FILE [--json]\n"
    "\n"
    "Prints the origin of a session (station, trainee, time, case, settings, machine) and a "
    "summary:\n"
    "steps, events, instruments, the largest displacement.\n"
    "\n"
    "For each instrument it compares the motion of the shown tip with that of the hand:\n"
    "  offset  the distance between the two\n"
    "  gain    the shown way over the hand's, least and most; negative where the warped space "
    "folds\n"
    "  turned  the angle between the two ways; 180 degrees in a fold\n"
    "  tilted  the angle between the two shafts\n"
    "It counts steps past the thresholds that people notice in a headset.\n"
    "\n"
    "Exits 1 if the file cannot be read at all. The command verify checks whether it is whole.\n";

static void hex_text(const uint8_t *bytes, size_t size, char *out) {
    for (size_t i = 0; i < size; i++)
        snprintf(out + 2 * i, 3, "%02x", bytes[i]);
}

static void time_text(int64_t utc_ns, char out[32]) {
    time_t seconds = (time_t)(utc_ns / NS_PER_S);
    struct tm utc;
    gmtime_r(&seconds, &utc);
    strftime(out, 32, "%Y-%m-%dT%H:%M:%SZ", &utc);
}

// Texts come from a file: what is no UTF-8 cannot be shown.
static json_t *text_or_null(const char *text) {
    json_t *value = json_string(text);
    return value ? value : json_null();
}

// Older traces lack how the shown motion differs from the hand's.
static bool compares_motion(const struct trace_header *h) {
    return h->version >= 3;
}

static json_t *settings_object(const struct session_settings *s) {
    return json_pack("{s:s, s:f, s:f, s:f, s:f, s:f, s:s, s:s, s:f, s:f, s:f}", "field",
                     field_name(s->field.kind), "unit_mm", s->field.unit_mm, "radius_mm",
                     s->field.radius_mm, "background_per_mm", s->field.background_per_mm, "skin_mm",
                     s->field.skin_mm, "strength", s->field.strength, "adaptive",
                     adaptive_name(s->adaptive), "avatar", avatar_mode_name(s->avatar), "hold_s",
                     (double)s->hold_ns / (double)NS_PER_S, "ease_share", s->ease_share,
                     "ease_mm_s", s->ease_mm_s);
}

static json_t *optic_object(const struct view_optic *optic) {
    return json_pack("{s:f, s:f}", "tilt_deg", optic->tilt_deg, "field_deg", optic->field_deg);
}

static json_t *events_object(const struct survey *s) {
    json_t *events = json_object();
    for (int i = 0; i < EVENT_COUNT; i++)
        json_object_set_new(events, event_name(i), json_integer((json_int_t)s->events[i]));
    return events;
}

// What a trainee might have noticed; shares of the steps in which the instrument was there.
static json_t *instrument_object(uint64_t present, const struct noticing *n, bool compared) {
    if (!compared)
        return json_pack("{s:I}", "steps", (json_int_t)present);
    double steps = (double)present;
    return json_pack("{s:I, s:f, s:f, s:f, s:f, s:f, s:{s:f, s:f, s:f, s:f}}", "steps",
                     (json_int_t)present, "offset_max_mm", n->worst.offset_mm, "turn_max_deg",
                     n->worst.turn_deg, "gain_max", n->worst.gain, "gain_min", n->worst.gain_least,
                     "penetration_max_mm", n->penetration_mm, "noticeable_share", "turn",
                     (double)n->turn / steps, "tilt", (double)n->tilt / steps, "gain",
                     (double)n->gain / steps, "any", (double)n->any / steps);
}

static json_t *instruments_object(const struct survey *s, bool compared) {
    json_t *instruments = json_object();
    for (int i = 0; i < INSTRUMENT_COUNT; i++)
        if (s->present[i])
            json_object_set_new(instruments,
                                channel_name((enum channel)(CHANNEL_FIRST_INSTRUMENT + i)),
                                instrument_object(s->present[i], &s->noticing[i], compared));
    return instruments;
}

static json_t *torn_array(const struct survey *s) {
    json_t *torn = json_array();
    for (int i = 0; i < s->torn_count; i++)
        json_array_append_new(torn, json_pack("{s:f}", "share_max", s->share[i]));
    return torn;
}

// Whether it is known where touch and sight differ: never of older rules, nor before a cut.
static bool is_measured(const struct tissue_figures *f) {
    return f->touched_unseen_mm3 + f->seen_untouched_mm3 > 0;
}

static json_t *resections_array(const struct survey *s) {
    json_t *all = json_array();
    for (int i = 0; i < TISSUES_MAX; i++) {
        const struct tissue_figures *f = &s->tissues[i];
        if (!f->mesh_number && !f->refused)
            continue;
        json_t *one = json_pack(
            "{s:i, s:i, s:i, s:i, s:f, s:f, s:f, s:f, s:f, s:f, s:f, s:f, s:f}", "tissue", i,
            "cuts", (int)f->cuts, "refused", (int)f->refused, "pieces", (int)f->pieces,
            "volume_mm3", f->volume_mm3, "removed_mm3", f->quality.removed_mm3 - f->pieces_mm3,
            "pieces_mm3", f->pieces_mm3, "left_mm3", f->left_mm3, "planned_mm3",
            f->quality.planned_mm3, "over_mm3", f->quality.over_mm3, "under_mm3",
            f->quality.under_mm3, "rim_mm", f->quality.rim_mm, "step_mm", f->quality.step_mm);
        if (is_measured(f))
            json_object_update_new(one, json_pack("{s:f, s:f}", "touched_unseen_mm3",
                                                  f->touched_unseen_mm3, "seen_untouched_mm3",
                                                  f->seen_untouched_mm3));
        json_array_append_new(all, one);
    }
    return all;
}

static double remark_seconds(const struct survey *s, const struct remark *r) {
    return (double)(r->time_ns - s->first_ns) / (double)NS_PER_S;
}

static json_t *remarks_array(const struct survey *s) {
    json_t *all = json_array();
    for (uint32_t i = 0; i < s->remark_count; i++) {
        const struct remark *r = &s->remarks[i];
        if (!r->number)
            continue;
        json_t *marker = json_null();
        if (r->has_marker)
            marker = json_pack("{s:s, s:[f, f, f]}", "body", body_name(r->body), "point_mm",
                               r->point.x, r->point.y, r->point.z);
        json_array_append_new(
            all, json_pack("{s:i, s:f, s:o, s:o, s:o, s:b}", "number", (int)r->number, "second",
                           remark_seconds(s, r), "author", text_or_null(r->author), "text",
                           text_or_null(r->text), "marker", marker, "withdrawn", r->withdrawn));
    }
    return all;
}

static uint64_t shown_markers(const struct survey *s) {
    return s->marker_count < SURVEY_MARKERS_MAX ? s->marker_count : SURVEY_MARKERS_MAX;
}

static double marker_seconds(const struct trace_header *h, const struct marker *m) {
    return (double)(m->time_ns - h->start_ns) / (double)NS_PER_S;
}

static json_t *markers_array(const struct trace_header *h, const struct survey *s) {
    json_t *all = json_array();
    for (uint64_t i = 0; i < shown_markers(s); i++) {
        const struct marker *m = &s->markers[i];
        json_array_append_new(all,
                              json_pack("{s:s, s:o, s:f, s:f, s:I, s:I}", "name", m->name, "device",
                                        text_or_null(m->device), "second", marker_seconds(h, m),
                                        "value", m->value, "number", (json_int_t)m->number,
                                        "time_ns", (json_int_t)m->time_ns));
    }
    return all;
}

static json_t *attempts_array(const struct survey *s) {
    json_t *all = json_array();
    for (uint64_t i = 0; i < survey_attempts(s); i++) {
        const struct trace_attempt *b = &s->attempts[i].begun;
        const struct trace_outcome *e = &s->attempts[i].ended;
        json_array_append_new(
            all,
            json_pack("{s:i, s:s, s:s, s:s, s:f, s:i, s:i, s:s, s:s, s:i, s:i, s:f, s:I, s:I}",
                      "number", (int)b->number, "task", b->task, "purpose",
                      attempt_purpose_name(b->purpose), "hand", attempt_hand_name(b->hand),
                      "pass_time_s", b->pass_time_s, "pass_errors", (int)b->pass_errors,
                      "mark_version", (int)b->mark_version, "end", attempt_end_name(e->end),
                      "verdict", verdict_name(e->verdict), "goals_met", (int)e->goals_met, "errors",
                      (int)e->errors, "time_s", 1e-9 * (double)e->time_ns, "first_step",
                      (json_int_t)e->first_step, "last_step", (json_int_t)e->last_step));
    }
    return all;
}

static void print_info_json(const struct trace_header *h, const struct survey *s) {
    char id[33], start[32], hash[17];
    hex_text(h->session_id, sizeof h->session_id, id);
    time_text(h->start_utc_ns, start);
    snprintf(hash, sizeof hash, "%016" PRIx64, h->case_hash);
    json_t *root = json_pack(
        "{s:s, s:o, s:o, s:{s:o, s:o, s:s}, s:s, s:i, s:o, s:{s:o, s:o, s:o}}", "session", id,
        "station", text_or_null(h->station), "trainee", text_or_null(h->trainee), "case", "name",
        text_or_null(h->case_name), "dir", text_or_null(h->case_dir), "hash", hash, "start", start,
        "version", (int)h->version, "settings", settings_object(&h->settings), "machine", "build",
        text_or_null(h->build), "libc", text_or_null(h->libc), "cpu", text_or_null(h->cpu));
    json_t *session =
        json_pack("{s:f, s:I, s:I, s:I, s:s, s:f, s:o, s:o, s:o, s:o, s:b}", "seconds",
                  survey_seconds(s), "steps", (json_int_t)s->steps, "frames", (json_int_t)s->frames,
                  "missing", (json_int_t)s->missing, "state", session_state_name(s->state),
                  "displacement_max_mm", s->largest_mm, "events", events_object(s), "instruments",
                  instruments_object(s, compares_motion(h)), "torn", torn_array(s), "resections",
                  resections_array(s), "whole", s->end == RESULT_CLOSED);
    json_object_update_new(root, session);
    char parent[2 * TRACE_HASH_SIZE + 1];
    bool is_made = trace_header_is_piece(h) || trace_header_is_copied(h);
    hex_text(h->parent, sizeof h->parent, parent);
    json_object_set_new(root, "parent", is_made ? json_string(parent) : json_null());
    hex_text(h->parent_id, sizeof h->parent_id, parent);
    json_object_set_new(root, "parent_session", is_made ? json_string(parent) : json_null());
    json_object_set_new(root, "optic", optic_object(&h->optic));
    json_object_set_new(root, "part", json_integer(h->part));
    json_object_set_new(root, "server", text_or_null(h->server));
    json_object_set_new(root, "token", json_integer((json_int_t)h->token));
    json_object_set_new(root, "from_utc_s", json_real((double)s->begun_utc_ns / 1e9));
    json_object_set_new(root, "until_utc_s", json_real((double)s->until_utc_ns / 1e9));
    json_object_set_new(root, "taken", json_integer((json_int_t)s->taken));
    json_object_set_new(root, "state_step", json_integer((json_int_t)s->state_step));
    json_object_set_new(root, "past", json_integer((json_int_t)s->past));
    json_object_set_new(root, "resumes", json_integer((json_int_t)s->resumes));
    json_object_set_new(root, "remarks", remarks_array(s));
    json_object_set_new(root, "markers", markers_array(h, s));
    json_object_set_new(root, "attempts", attempts_array(s));
    json_object_set_new(root, "markers_count", json_integer((json_int_t)s->marker_count));
    if (s->touches)
        json_object_set_new(root, "touches",
                            json_pack("{s:I, s:I}", "count", (json_int_t)s->touches, "bytes",
                                      (json_int_t)s->touch_bytes));
    json_dumpf(root, stdout, JSON_INDENT(2) | JSON_REAL_PRECISION(12));
    putchar('\n');
    json_decref(root);
}

static void print_seen_instrument(enum channel channel, uint64_t present, const struct noticing *n,
                                  bool compared) {
    if (!compared) {
        printf("instrument  %s in %" PRIu64 " steps\n", channel_name(channel), present);
        return;
    }
    double percent = 100 / (double)present;
    printf(
        "instrument  %s in %" PRIu64 " steps; might be noticed in %.1f %% of them (turned %.1f, "
        "tilted %.1f, gain %.1f): offset up to %.2f mm, turned %.1f degrees, gain %.2f to %.2f\n",
        channel_name(channel), present, percent * (double)n->any, percent * (double)n->turn,
        percent * (double)n->tilt, percent * (double)n->gain, n->worst.offset_mm, n->worst.turn_deg,
        n->worst.gain_least, n->worst.gain);
}

static void print_remark(const struct survey *s, const struct remark *r) {
    printf("remark %-4u %.1f s, %s: %s", r->number, remark_seconds(s, r), r->author, r->text);
    if (r->has_marker)
        printf(" [touch %.1f %.1f %.1f of the %s]", r->point.x, r->point.y, r->point.z,
               body_name(r->body));
    puts(r->withdrawn ? " (withdrawn)" : "");
}

static void print_markers(const struct trace_header *h, const struct survey *s) {
    for (uint64_t i = 0; i < shown_markers(s); i++) {
        const struct marker *m = &s->markers[i];
        printf("marker      %.4f s, %s of %s: %.12g\n", marker_seconds(h, m), m->name, m->device,
               m->value);
    }
    if (s->marker_count > shown_markers(s))
        printf("marker      %" PRIu64 " more: arthron-trace export --markers has them all\n",
               s->marker_count - shown_markers(s));
}

static void print_attempts(const struct survey *s) {
    for (uint64_t i = 0; i < survey_attempts(s); i++) {
        const struct trace_attempt *b = &s->attempts[i].begun;
        const struct trace_outcome *e = &s->attempts[i].ended;
        printf("attempt %-3u %s, %s, scope in the %s hand: ", b->number, b->task,
               attempt_purpose_name(b->purpose), attempt_hand_name(b->hand));
        if (e->number)
            printf("%s (%s) after %.1f s, %u goals met, %u errors\n", verdict_name(e->verdict),
                   attempt_end_name(e->end), 1e-9 * (double)e->time_ns, e->goals_met, e->errors);
        else
            puts("its end is not recorded");
    }
    if (s->attempt_count > survey_attempts(s))
        printf("attempt     %" PRIu64 " more\n", s->attempt_count - survey_attempts(s));
}

static void print_origin(const struct trace_header *h) {
    char id[33], start[32];
    hex_text(h->session_id, sizeof h->session_id, id);
    time_text(h->start_utc_ns, start);
    printf("session     %s\n", id);
    printf("station     %s\ntrainee     %s\n", h->station, h->trainee);
    printf("case        %s, hash %016" PRIx64 ", %s\n", h->case_name, h->case_hash, h->case_dir);
    printf("start       %s\n", start);
    printf("warp        %s, strength %g, ligaments %s, instruments %s\n",
           field_name(h->settings.field.kind), h->settings.field.strength,
           adaptive_name(h->settings.adaptive), avatar_mode_name(h->settings.avatar));
    printf("optic       %g degrees, field %g degrees\n", h->optic.tilt_deg, h->optic.field_deg);
    if (h->server[0])
        printf("server      %s, by token %" PRIu64 "\n", h->server, h->token);
    printf("recorded by build %s, %s, %s\n", h->build, h->libc, h->cpu);
}

static void print_course(const struct trace_header *h, const struct survey *s) {
    char id[33];
    printf("length      %.2f s, %" PRIu64 " steps, %" PRIu64 " of them frames, %" PRIu64
           " missing\n",
           survey_seconds(s), s->steps, s->frames, s->missing);
    hex_text(h->parent_id, sizeof h->parent_id, id);
    if (trace_header_is_copied(h))
        printf("copied      from session %s; %" PRIu64 " inputs of it before\n", id, s->past);
    if (trace_header_is_piece(h))
        printf("piece       of another trace; %" PRIu64 " inputs before it\n", s->past);
    if (h->part > 1)
        printf("part        %u of the session: it begins with the state behind step %" PRIu64
               ", %" PRIu64 " jobs and %" PRIu64 " commands\n",
               h->part, s->state_step, s->taken, s->past);
    if (s->faults)
        printf("disk        failed %" PRIu64 " times; the bytes in doubt were written again\n",
               s->faults);
    if (s->resumes)
        printf("resumed     %" PRIu64 " times after its server was killed\n", s->resumes);
    printf("state       %s\n", session_state_name(s->state));
    for (int i = 0; i < EVENT_COUNT; i++)
        if (s->events[i])
            printf("event       %s in %" PRIu64 " steps\n", event_name(i), s->events[i]);
}

static void print_resection(int tissue, const struct tissue_figures *f) {
    if (f->mesh_number || f->refused)
        printf("resection   tissue %d: %u cuts took %.1f mm3, %u pieces %.1f mm3; over the plan "
               "%.1f, short of it %.1f mm3; rim %.2f mm; %.1f mm3 not matched; %u refused\n",
               tissue, f->cuts, f->quality.removed_mm3, f->pieces, f->pieces_mm3,
               f->quality.over_mm3, f->quality.under_mm3, f->quality.rim_mm, f->left_mm3,
               f->refused);
    if (is_measured(f))
        printf("touch       tissue %d: %.1f mm3 touched where nothing is seen, %.1f mm3 seen where "
               "nothing is touched\n",
               tissue, f->touched_unseen_mm3, f->seen_untouched_mm3);
}

static void print_info_text(const struct trace_header *h, const struct survey *s) {
    print_origin(h);
    print_course(h, s);
    for (int i = 0; i < INSTRUMENT_COUNT; i++)
        if (s->present[i])
            print_seen_instrument((enum channel)(CHANNEL_FIRST_INSTRUMENT + i), s->present[i],
                                  &s->noticing[i], compares_motion(h));
    for (int i = 0; i < s->torn_count; i++)
        printf("ligament    torn one %d: up to %.0f %% of its extra motion\n", i + 1,
               100 * s->share[i]);
    for (int i = 0; i < TISSUES_MAX; i++)
        print_resection(i, &s->tissues[i]);
    if (s->touches)
        printf("recorded    the touched surface after %" PRIu64 " changes, %" PRIu64 " bytes\n",
               s->touches, s->touch_bytes);
    for (uint32_t i = 0; i < s->remark_count; i++)
        if (s->remarks[i].number)
            print_remark(s, &s->remarks[i]);
    print_markers(h, s);
    print_attempts(s);
    printf("displaced   by up to %.3f mm\n", s->largest_mm);
    if (s->end != RESULT_CLOSED)
        printf("not whole   %s\n", s->why.text);
}

int command_info(int argc, char **argv) {
    static const struct option options[] = {
        {"json", no_argument, NULL, 'j'}, {"help", no_argument, NULL, 'h'}, {NULL, 0, NULL, 0}};
    bool json = false;
    for (int c; (c = getopt_long(argc, argv, "", options, NULL)) != -1;) {
        if (c == 'h')
            return fputs(info_help, stdout) < 0;
        if (c != 'j')
            return usage_error(argv[0], "unknown option");
        json = true;
    }
    const char *file = NULL;
    if (take_file(argc, argv, &file) != EXIT_GOOD)
        return EXIT_USAGE;
    struct trace_reader *reader;
    struct error err;
    if (trace_reader_create(file, &reader, &err) != RESULT_OK)
        return failed(argv[0], &err);
    instruments_name_channels(&trace_reader_header(reader)->settings.instruments);
    struct survey survey;
    survey_read(reader, show_progress, &survey);
    (json ? print_info_json : print_info_text)(trace_reader_header(reader), &survey);
    trace_reader_destroy(&reader);
    return EXIT_GOOD;
}
