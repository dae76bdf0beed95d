#include "runtime/reply.h"

#include "base/check.h"
#include "metrics/subject.h"

#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>

static enum body nearest_body(const struct instrument_output *instrument,
                              const struct knee_case *knee) {
    int group = instrument->warp.nearest;
    return group < 0 ? BODY_FEMUR : knee->groups[group].body;
}

static void fill_instrument(const struct session_output *output, int index,
                            const struct knee_case *knee, arthron_WarpedInstrument *out) {
    const struct instrument_output *instrument = &output->instruments[index];
    enum body body = nearest_body(instrument, knee);
    pose T_body_mockup = pose_inverse(output->T_mockup_body[body]);
    struct avatar_extrapolation extrapolation =
        avatar_extrapolation_in(T_body_mockup, &instrument->extrapolation);

    out->channel = (uint8_t)(CHANNEL_FIRST_INSTRUMENT + index);
    out->validity = (arthron_Validity)instrument->validity;
    out->body = (arthron_Body)body;
    out->has_pose = true;
    out->pose = wire_pose_from(pose_compose(T_body_mockup, instrument->T_mockup_warped));
    wire_extrapolation_from(&extrapolation, out);
    double nearest = instrument->warp.nearest_mm;
    out->nearest_mm = isfinite(nearest) ? (float)nearest : -1;
}

// If more are present than a reply has room for, they take turns.
static void fill_instruments(const struct session_output *output, const struct knee_case *knee,
                             arthron_Reply *out) {
    int present[INSTRUMENT_COUNT], count = 0;
    for (int i = 0; i < INSTRUMENT_COUNT; i++)
        if (output->instruments[i].present)
            present[count++] = i;
    bool all = count <= WIRE_REPLY_INSTRUMENTS;
    int first = all ? 0 : (int)(out->frame_number * WIRE_REPLY_INSTRUMENTS % (unsigned)count);
    for (int k = 0; k < count && k < WIRE_REPLY_INSTRUMENTS; k++)
        fill_instrument(output, present[(first + k) % count], knee,
                        &out->instruments[out->instruments_count++]);
}

static void fill_corrections(const struct session_output *output, arthron_Reply *out) {
    for (int body = BODY_TIBIA; body < BODY_COUNT; body++) {
        const pose *T_mockup_body = &output->T_mockup_body[body];
        const pose *T_mockup_virtual = &output->T_mockup_virtual[body];
        if (memcmp(T_mockup_body, T_mockup_virtual, sizeof *T_mockup_body) == 0)
            continue;
        pose T_body_virtual = pose_compose(pose_inverse(*T_mockup_body), *T_mockup_virtual);
        out->corrections[out->corrections_count++] =
            (arthron_Correction){(arthron_Body)body, true, wire_pose_from(T_body_virtual)};
    }
}

uint8_t reply_carrier(int carrier) {
    return (uint8_t)(carrier < BODY_COUNT ? carrier
                                          : CHANNEL_FIRST_INSTRUMENT + carrier - BODY_COUNT);
}

// Where it was last in its holder, nobody knows once the holder is not seen: nothing is then told.
static void fill_carried(const struct session_output *output, int number, arthron_Reply *out) {
    const struct loose_output *loose = &output->loose[number];
    int holder = loose->carrier - BODY_COUNT;
    bool is_out = loose->state == LOOSE_OUT;
    if (!is_out && holder >= 0 && !output->instruments[holder].present)
        return;
    arthron_CarriedLoose *m = &out->loose[out->loose_count++];
    *m = (arthron_CarriedLoose){.number = (uint8_t)number,
                                .state = (arthron_LooseMoment_State)loose->state,
                                .on = reply_carrier(loose->carrier),
                                .has_pose = !is_out};
    if (is_out)
        return;
    pose T_mockup_carrier = holder < 0 ? output->T_mockup_virtual[loose->carrier]
                                       : output->instruments[holder].T_mockup_warped;
    m->pose =
        wire_short_pose_from(pose_compose(pose_inverse(T_mockup_carrier), loose->T_mockup_loose));
}

// They take turns: of two in a row there is always the next, even where one has no room.
static void fill_loose(const struct session_output *output, arthron_Reply *out) {
    for (int i = 0; i < output->loose_count && i < WIRE_REPLY_LOOSE; i++)
        fill_carried(output, (int)((output->step + (unsigned)i) % (unsigned)output->loose_count),
                     out);
}

void reply_from_output(const struct session_output *output, const struct knee_case *knee,
                       uint64_t frame_number, int64_t frame_time_ns, arthron_Reply *out) {
    memset(out, 0, sizeof *out);
    out->frame_number = frame_number;
    out->frame_time_ns = frame_time_ns;
    out->state = (arthron_SessionState)output->state;
    out->events = output->events;
    fill_instruments(output, knee, out);
    fill_corrections(output, out);
    fill_loose(output, out);
}

void reply_session(enum session_state state, const struct knee_case *knee,
                   arthron_SessionChange *out) {
    struct knee_frame frame = {.joint = knee->joint, .patella_count = knee->patella_key_count};
    memcpy(frame.patella, knee->patella_keys, sizeof frame.patella);
    *out = (arthron_SessionChange){
        .state = (arthron_SessionState)state, .case_hash = knee->hash, .has_knee = true};
    memcpy(out->case_name, knee->name, sizeof out->case_name);
    wire_knee_from(&frame, &out->knee);
}

_Static_assert((int)_arthron_CaseGroup_Kind_ARRAYSIZE == TISSUE_KIND_COUNT &&
                   (int)arthron_CaseGroup_Kind_SKIN == TISSUE_SKIN &&
                   (int)_arthron_CaseGroup_Side_ARRAYSIZE == TISSUE_SIDE_COUNT,
               "kinds and sides on the wire are those of case/tissue.h");
_Static_assert(sizeof((arthron_LiveSession *)0)->groups / sizeof(arthron_CaseGroup) ==
                       CASE_GROUPS_MAX &&
                   sizeof((arthron_CaseGroup *)0)->name == CASE_NAME_MAX &&
                   sizeof((arthron_CaseGroup *)0)->label == TISSUE_LABEL_MAX,
               "every group of a case fits");
_Static_assert(sizeof((arthron_LiveSession *)0)->loose / sizeof(arthron_LooseBody) ==
                       CASE_LOOSE_MAX &&
                   sizeof((arthron_LooseBody *)0)->name == CASE_NAME_MAX,
               "every loose body of a case fits");

static void take_loose(const struct knee_case *knee, arthron_LiveSession *out) {
    out->loose_count = (pb_size_t)knee->loose_count;
    for (int i = 0; i < knee->loose_count; i++) {
        vec3 radii = knee->loose[i].radii_mm;
        out->loose[i] = (arthron_LooseBody){
            .radii_mm_count = 3, .radii_mm = {(float)radii.x, (float)radii.y, (float)radii.z}};
        memcpy(out->loose[i].name, knee->loose[i].name, CASE_NAME_MAX);
    }
}

void reply_groups(const struct knee_case *knee, arthron_LiveSession *out) {
    out->groups_count = (pb_size_t)knee->group_count;
    for (int i = 0; i < knee->group_count; i++) {
        const struct case_group *group = &knee->groups[i];
        const struct case_tissue *tissue = &group->tissue;
        out->groups[i] = (arthron_CaseGroup){
            .kind = (arthron_CaseGroup_Kind)tissue->kind,
            .colour = tissue->colour,
            .own_colour = tissue->colour != tissue_colour(tissue->kind),
            .side = (arthron_CaseGroup_Side)tissue->side,
            .cuttable = group->cuttable,
            .has_zones = tissue->has_zones,
        };
        memcpy(out->groups[i].name, group->name, CASE_NAME_MAX);
        memcpy(out->groups[i].label, tissue->label, TISSUE_LABEL_MAX);
    }
    take_loose(knee, out);
}

static void take_zones(const struct zone_volumes *zones, float out[9]) {
    for (int i = 0; i < ZONE_ALONG_COUNT; i++)
        for (int k = 0; k < ZONE_ACROSS_COUNT; k++)
            out[i * ZONE_ACROSS_COUNT + k] = (float)zones->mm3[i][k];
}

void reply_resection(const struct tissue_figures *f, const char *group, uint64_t mesh_hash,
                     arthron_Resection *out) {
    *out = (arthron_Resection){
        .mesh_hash = mesh_hash,
        .mesh_number = f->mesh_number,
        .cuts = f->cuts,
        .cuts_refused = f->refused,
        .pieces = f->pieces,
        .volume_mm3 = f->volume_mm3,
        .removed_mm3 = f->quality.removed_mm3 - f->pieces_mm3,
        .pieces_mm3 = f->pieces_mm3,
        .warped_mm3 = f->warped_mm3,
        .left_mm3 = f->left_mm3,
        .distance_mm = f->distance_mm,
        .touched_unseen_mm3 = f->touched_unseen_mm3,
        .seen_untouched_mm3 = f->seen_untouched_mm3,
        .planned_mm3 = f->quality.planned_mm3,
        .over_mm3 = f->quality.over_mm3,
        .under_mm3 = f->quality.under_mm3,
        .damage_mm3 = f->quality.damage_mm3,
        .rim_mm = f->quality.rim_mm,
        .step_mm = f->quality.step_mm,
    };
    snprintf(out->group, sizeof out->group, "%s", group);
    take_zones(&f->quality.whole, out->whole_zone_mm3);
    take_zones(&f->quality.removed, out->removed_zone_mm3);
    take_zones(&f->quality.budget, out->budget_zone_mm3);
}

_Static_assert(sizeof((arthron_Metric *)0)->subject >= SUBJECT_MAX, "what a figure is about fits");

#define METRICS_MAX (sizeof((arthron_Metrics *)0)->metrics / sizeof(arthron_Metric))

struct metrics_message {
    const struct knee_case *knee;
    arthron_Metrics *out;
};

static void take_metric(void *context, const struct metric_value *v) {
    const struct metrics_message *t = context;
    const struct metric_kind *kind = &metric_kinds[v->metric];
    if (t->out->metrics_count == METRICS_MAX || (v->depth >= 0 && v->value == 0))
        return;
    arthron_Metric *m = &t->out->metrics[t->out->metrics_count++];
    *m = (arthron_Metric){
        .version = (uint32_t)kind->version, .value = v->value, .below_floor = v->below_floor};
    snprintf(m->name, sizeof m->name, "%s", kind->name);
    snprintf(m->unit, sizeof m->unit, "%s", kind->unit);
    subject_text(t->knee, v, m->subject);
}

void reply_metrics(const struct metrics *metrics, const struct knee_case *knee,
                   arthron_Metrics *out) {
    struct metrics_message message = {knee, out};
    out->metrics_count = 0;
    metrics_each(metrics, knee, take_metric, &message);
}

void reply_why(arthron_Why_Code code, const char *parameter, arthron_Why *out) {
    *out = (arthron_Why){.code = code, .parameters_count = parameter != NULL};
    if (parameter)
        snprintf(out->parameters[0], sizeof out->parameters[0], "%s", parameter);
}

void reply_why_also(const char *parameter, arthron_Why *why) {
    CHECK(why->parameters_count < sizeof why->parameters / sizeof *why->parameters);
    snprintf(why->parameters[why->parameters_count++], sizeof *why->parameters, "%s", parameter);
}

bool reply_refuse(arthron_CommandReply *reply, const char *format, ...) {
    va_list args;
    va_start(args, format);
    vsnprintf(reply->text, sizeof reply->text, format, args);
    va_end(args);
    reply->has_why = false;
    return reply->ok = false;
}

bool reply_refuse_as(arthron_CommandReply *reply, arthron_Why_Code code, const char *parameter,
                     const char *format, ...) {
    va_list args;
    va_start(args, format);
    vsnprintf(reply->text, sizeof reply->text, format, args);
    va_end(args);
    reply->has_why = true;
    reply_why(code, parameter, &reply->why);
    return reply->ok = false;
}
