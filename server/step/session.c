#include "step/session.h"

#include "base/check.h"
#include "base/clock.h"
#include "step/bones.h"
#include "step/fields.h"
#include "step/session_parts.h"

#include <stdlib.h>
#include <string.h>

#define TRAVEL_MAX_NS NS_PER_S
#define CONTACT_MM 0.2
#define RELEASE_MM 0.4

// An instrument that is deeper in keeps its portal, unless its shaft has left it.
#define PORTAL_HOLD_MM 5.0
#define PORTAL_ASIDE_MM 20.0

static void forget(struct session *s) {
    memset(s->samples.known, 0, sizeof s->samples.known);
    memset(s->in_contact, 0, sizeof s->in_contact);
    memset(s->seen, 0, sizeof s->seen);
    memset(s->portals, -1, sizeof s->portals);
    cutting_rest(&s->cutting);
    cutting_drop_waiting(&s->cutting);
    for (int i = 0; i < INSTRUMENT_COUNT; i++)
        avatar_memory_init(&s->memory[i]);
}

void session_take_surface(struct session *s, int tissue) {
    struct warp_surface *surface = &s->surfaces[s->scene->tissues[tissue].group];
    surface->displacement = easing_displacement(s->easings[tissue]);
    surface->mean = easing_mean(s->easings[tissue]);
    if (easing_integral(s->easings[tissue]))
        surface->integral = easing_integral(s->easings[tissue]);
}

static void take_surfaces(struct session *s) {
    memcpy(s->surfaces, s->scene->surfaces, sizeof s->surfaces);
    for (int t = 0; t < s->scene->tissue_count; t++) {
        if (!s->scene->tissues[t].match)
            continue;
        s->easings[t] = easing_create(s->scene, t, &s->settings.field, s->settings.rules);
        session_take_surface(s, t);
    }
}

struct session *session_create(const struct scene *scene, const struct session_settings *settings) {
    CHECK(settings->field.strength >= 0 && settings->field.strength <= 1);
    CHECK(settings->rules >= 1 && settings->rules <= RULES_NEWEST);
    CHECK(settings->hold_ns >= 0);
    CHECK(settings->instruments.count >= INSTRUMENTS_USUAL &&
          settings->instruments.count <= INSTRUMENT_COUNT);
    CHECK(settings->ease_share >= 0 && settings->ease_mm_s >= 0);
    struct session *s = alloc(1, sizeof *s);
    s->scene = scene;
    s->settings = *settings;
    s->cutting.rules = settings->rules;
    s->cutting.instruments = &s->settings.instruments;
    s->loose = loose_create(scene->knee, scene->loose_ground);
    take_surfaces(s);
    forget(s);
    return s;
}

void session_destroy(struct session **session) {
    for (int t = 0; t < TISSUES_MAX; t++)
        easing_destroy(&(*session)->easings[t]);
    loose_destroy(&(*session)->loose);
    free(*session);
    *session = NULL;
}

bool session_is_changed(const struct session *s) {
    bool changed = s->loose && loose_has_moved(s->loose);
    for (int t = 0; t < s->scene->tissue_count; t++)
        changed |= s->touched[t];
    return changed;
}

void session_make_room(struct session *s, const struct job_result *result) {
    if (s->easings[result->tissue] && result->touch.count)
        easing_make_room(s->easings[result->tissue]);
}

bool session_rests(const struct session *s) {
    bool waits = s->to_undo > 0 || cutting_waits(&s->cutting, UINT32_MAX) || s->loose_moves;
    for (int t = 0; t < s->scene->tissue_count; t++)
        waits |= s->to_restore[t] || (s->easings[t] && easing_active(s->easings[t]));
    return !waits && samples_are_lost(&s->samples);
}

// ---- inputs -------------------------------------------------------------------------------------

static enum session_state next_state(enum session_state state, enum input_kind kind) {
    if (state == SESSION_CLOSED)
        return SESSION_CLOSED;
    switch (kind) {
    case INPUT_START:
    case INPUT_RESET:
        return SESSION_RUNNING;
    case INPUT_PAUSE:
        return state == SESSION_RUNNING ? SESSION_PAUSED : state;
    case INPUT_STOP:
        return SESSION_CLOSED;
    default:
        return state;
    }
}

// The warp is whole at once; the caller's operation has to be told by a job for each tissue.
static void restore_tissues(struct session *s) {
    s->to_undo = 0;
    for (int t = 0; t < s->scene->tissue_count; t++) {
        s->to_restore[t] |= s->touched[t];
        s->touched[t] = false;
        if (s->easings[t])
            easing_restore(s->easings[t]);
    }
}

static uint32_t change_state(struct session *s, enum input_kind kind) {
    enum session_state before = s->state;
    s->state = next_state(before, kind);
    if (kind == INPUT_UNDO) {
        s->to_undo += s->scene->tissue_count > 0;
        s->undo_behind = s->cutting.stroke_count;
        cutting_end_strokes(&s->cutting);
    }
    if (kind == INPUT_RESET && before != SESSION_CLOSED) {
        forget(s);
        restore_tissues(s);
        if (s->loose)
            loose_reset(s->loose);
        return EVENT_STATE;
    }
    return s->state != before ? EVENT_STATE : 0;
}

static uint32_t age_samples(struct session *s) {
    return samples_age(&s->samples, s->time_ns - s->travel_ns, s->settings.hold_ns);
}

static uint32_t take_samples(struct session *s, const struct frame *frame) {
    uint32_t events = 0;
    int64_t travel_ns = s->time_ns - frame->time_ns;
    if (s->settings.rules < RULES_WITHOUT_TRAVEL || travel_ns < 0)
        travel_ns = 0;
    s->travel_ns = travel_ns < TRAVEL_MAX_NS ? travel_ns : TRAVEL_MAX_NS;
    struct sampling at = {s->time_ns - s->travel_ns, frame->time_ns, s->settings.hold_ns,
                          s->settings.rules >= RULES_HELD_FROM_FRAME};
    for (int i = 0; i < frame->count; i++)
        events |= samples_take(&s->samples, &frame->samples[i], at);
    return events;
}

// A cut that was asked for before the tissue was restored changes nothing any more.
static uint32_t land(struct session *s, const struct session_input *input, struct landed *out) {
    const struct job_result *result = input->result;
    enum job_kind kind = s->job_out;
    if (kind == JOB_NONE || input->job != s->last_job)
        return 0;
    s->job_out = JOB_NONE;
    s->is_astray |= !result;
    if (!result || s->to_restore[result->tissue])
        return 0;
    CHECK(result->job == input->job);
    *out = (struct landed){input->job,      result->outcome, result->tissue,
                           result->figures, result->hash,    result->touch_hash};
    if (s->easings[result->tissue]) {
        easing_aim(s->easings[result->tissue], &result->touch);
        session_take_surface(s, result->tissue);
    }
    if (result->outcome == JOB_REFUSED)
        return EVENT_REFUSED;
    if (result->outcome == JOB_DONE && kind == JOB_UNDO) {
        s->to_undo += result->more;
        return EVENT_UNDONE;
    }
    if (result->outcome != JOB_DONE || kind != JOB_CUT)
        return 0;
    cutting_landed(&s->cutting, s->stroke_out, s->time_ns);
    return EVENT_CUT | (result->change.piece_count ? EVENT_PIECE : 0);
}

static uint32_t take_input(struct session *s, const struct session_input *input,
                           struct landed *out_landed) {
    CHECK(input->time_ns >= s->time_ns);
    s->time_ns = input->time_ns;
    if (input->kind == INPUT_JOB)
        return land(s, input, out_landed) | age_samples(s);
    if (input->kind != INPUT_FRAME)
        return change_state(s, input->kind) | age_samples(s);
    CHECK(frame_is_valid(&input->frame));
    return take_samples(s, &input->frame) | age_samples(s);
}

// ---- bones --------------------------------------------------------------------------------------

// The corrections are kept: instruments need them.
static void correct_bones(struct session *s, struct session_output *out) {
    struct adaptive_warp adaptive;
    scene_correct(s->scene, s->settings.adaptive, settings_ramp(&s->settings), out->T_mockup_body,
                  &adaptive, s->correction);
    memcpy(out->T_mockup_virtual, out->T_mockup_body, sizeof out->T_mockup_virtual);
    if (s->scene->knee->torn_count)
        out->T_mockup_virtual[BODY_TIBIA] =
            pose_compose(s->correction[BODY_TIBIA], out->T_mockup_body[BODY_TIBIA]);
    out->torn_count = s->scene->knee->torn_count;
    memcpy(out->opening, adaptive.opening, sizeof out->opening);
    memcpy(out->share, adaptive.share, sizeof out->share);
}

// ---- easing -------------------------------------------------------------------------------------

// Displacements are kept as floats: what rounding adds stays within the allowance.
#define EASE_ROUNDING 0.998

// How far the displacement at a tip may change at this step for the sake of new blends. Who was not
// seen at the step before can see no jump.
static double allowance_mm(const struct session *s, int instrument, int64_t passed_ns, vec3 tip) {
    if (!s->seen[instrument])
        return INFINITY;
    double way = vec3_distance(tip, s->tips[instrument].translation);
    double floor_mm = s->settings.ease_mm_s * (double)passed_ns / NS_PER_S;
    return EASE_ROUNDING * (s->settings.ease_share * way + floor_mm);
}

// How much the displacement that an instrument feels would still change: its tip, or any point.
static double rest_mm(const struct session *s, int instrument, int tissue, const pose *bodies,
                      pose T_mockup_tip) {
    const struct instrument_body *body = &s->settings.bodies[instrument];
    int group = s->scene->tissues[tissue].group;
    int count = s->settings.avatar == AVATAR_TIP ? 1 : body->point_count;
    pose T_group_mockup = pose_inverse(bodies[s->scene->knee->groups[group].body]);
    pose T_group_tip = pose_compose(T_group_mockup, T_mockup_tip);
    double rest = 0;
    for (int i = 0; i < count; i++) {
        vec3 p = pose_apply(T_group_tip, body->points[i].at);
        uint32_t triangle = s->memory[instrument].points[i].triangle[group];
        rest = fmax(rest, easing_rest_mm(s->easings[tissue], p, triangle));
    }
    return rest;
}

// A hand that trembles comes back to where it was.
static double rest_here_and_before_mm(const struct session *s, const struct session_output *out,
                                      int instrument, int tissue) {
    double here = rest_mm(s, instrument, tissue, out->T_mockup_body,
                          out->instruments[instrument].T_mockup_tip);
    if (!s->seen[instrument] || s->settings.rules < RULES_EASED_BEHIND)
        return here;
    return fmax(here, rest_mm(s, instrument, tissue, s->bodies, s->tips[instrument]));
}

// The share of what is left that a tissue's blends may go: what bounds the change that each tip
// would notice, since W is a mean of displacements.
static double ease_share(const struct session *s, int tissue, int active, int64_t passed_ns,
                         const struct session_output *out) {
    double share = 1;
    for (int i = 0; i < INSTRUMENT_COUNT; i++) {
        const struct instrument_output *o = &out->instruments[i];
        if (!o->present)
            continue;
        double rest = rest_here_and_before_mm(s, out, i, tissue);
        double allowed = allowance_mm(s, i, passed_ns, o->T_mockup_tip.translation) / active;
        if (allowed < share * rest)
            share = allowed / rest;
    }
    return share;
}

// True where a displacement changed.
static bool ease(struct session *s, int64_t passed_ns, const struct session_output *out) {
    bool is_active[TISSUES_MAX] = {0};
    int active = 0;
    for (int t = 0; t < s->scene->tissue_count; t++)
        active += is_active[t] = s->easings[t] && easing_active(s->easings[t]);
    for (int t = 0; active && t < s->scene->tissue_count; t++)
        if (is_active[t])
            easing_advance(s->easings[t], ease_share(s, t, active, passed_ns, out));
    return active > 0;
}

// ---- instruments --------------------------------------------------------------------------------

struct passage {
    vec3 portal;
    double past, aside; // of the tip, along the shaft; of the shaft
};

static struct passage passage_of(const struct session *s, const struct session_output *out,
                                 int index, pose T_mockup_tip) {
    vec3 in_femur = s->scene->knee->portals[index].position;
    struct passage p = {.portal = pose_apply(out->T_mockup_body[BODY_FEMUR], in_femur)};
    vec3 u = quat_rotate(T_mockup_tip.rotation, (vec3){0, 0, 1});
    vec3 way = vec3_sub(T_mockup_tip.translation, p.portal);
    p.past = vec3_dot(way, u);
    p.aside = vec3_length(vec3_add_scaled(way, -p.past, u));
    return p;
}

// The portal that the shaft passes nearest to. The instrument keeps it while it is inside.
static vec3 portal_of(struct session *s, const struct session_output *out, int instrument,
                      pose T_mockup_tip) {
    int *kept = &s->portals[instrument];
    struct passage best = {.aside = INFINITY};
    if (*kept >= 0)
        best = passage_of(s, out, *kept, T_mockup_tip);
    if (*kept >= 0 && best.past > PORTAL_HOLD_MM && best.aside < PORTAL_ASIDE_MM)
        return best.portal;
    for (int i = 0; i < s->scene->knee->portal_count; i++) {
        struct passage passage = passage_of(s, out, i, T_mockup_tip);
        if (passage.aside >= best.aside)
            continue;
        best = passage;
        *kept = i;
    }
    return best.portal;
}

static void warp_instrument(struct session *s, struct session_output *out, int instrument) {
    struct instrument_output *o = &out->instruments[instrument];
    struct warp_scene scene = {s->surfaces, s->scene->knee->group_count, out->T_mockup_body,
                               s->correction};
    const struct instrument_body *shape = &s->settings.bodies[instrument];
    enum avatar_mode mode = s->scene->knee->portal_count ? s->settings.avatar : AVATAR_TIP;
    struct avatar_body body = {mode, shape->points, shape->point_count};
    struct avatar avatar;
    avatar_warp(&scene, &s->settings.field, &body, portal_of(s, out, instrument, o->T_mockup_tip),
                o->T_mockup_tip, &s->memory[instrument], &avatar);
    o->T_mockup_warped = avatar.T_world_warped;
    o->warp = avatar.tip;
    o->extrapolation = avatar.extrapolation;
    o->penetration_mm = avatar.penetration_mm;
    o->tip_gap_mm = avatar.tip_gap_mm;
    o->discrepancy = discrepancy_of(&o->extrapolation, o->T_mockup_tip, o->T_mockup_warped,
                                    s->settings.rules < RULES_BY_DERIVATIVE);
}

static uint32_t feel_contact(struct session *s, int instrument, double distance_mm) {
    bool *in_contact = &s->in_contact[instrument];
    if (!*in_contact && distance_mm < CONTACT_MM) {
        *in_contact = true;
        return EVENT_CONTACT;
    }
    if (*in_contact && distance_mm > RELEASE_MM) {
        *in_contact = false;
        return EVENT_RELEASE;
    }
    return 0;
}

static void place_instrument(struct session *s, int instrument, struct session_output *out) {
    enum channel channel = (enum channel)(CHANNEL_FIRST_INSTRUMENT + instrument);
    struct instrument_output *o = &out->instruments[instrument];
    const struct sample *tip = samples_last(&s->samples, channel, SAMPLE_POSE);
    const struct sample *handle = samples_last(&s->samples, channel, SAMPLE_HANDLE);
    if (!tip || tip->validity == VALIDITY_LOST)
        return;
    o->present = true;
    o->validity = tip->validity;
    o->T_mockup_tip = tip->T_mockup_body;
    o->handle_validity = VALIDITY_LOST;
    if (handle) {
        o->handle = handle->handle;
        o->handle.opening =
            instrument_opening(&s->settings.instruments.of[instrument], &handle->handle);
        o->handle_validity = handle->validity;
    }
    warp_instrument(s, out, instrument);
}

static uint32_t move_instruments(struct session *s, int64_t passed_ns, struct session_output *out) {
    uint32_t events = 0;
    for (int i = 0; i < s->settings.instruments.count; i++)
        place_instrument(s, i, out);
    if (ease(s, passed_ns, out))
        for (int i = 0; i < INSTRUMENT_COUNT; i++)
            if (out->instruments[i].present)
                warp_instrument(s, out, i);
    for (int i = 0; i < INSTRUMENT_COUNT; i++) {
        const struct instrument_output *o = &out->instruments[i];
        events |= feel_contact(s, i, o->present ? o->warp.nearest_mm : INFINITY);
        s->seen[i] = o->present;
        s->tips[i] = o->T_mockup_tip;
    }
    memcpy(s->bodies, out->T_mockup_body, sizeof s->bodies);
    return events;
}

// ---- loose bodies -------------------------------------------------------------------------------

static uint32_t move_loose(struct session *s, int64_t passed_ns, struct session_output *out) {
    struct loose_tools tools = {&s->settings.instruments, s->settings.bodies, s->portals};
    uint32_t cut = 0;
    for (int t = 0; t < s->scene->tissue_count; t++)
        cut |= (uint32_t)s->touched[t] << s->scene->tissues[t].group;
    uint32_t events =
        loose_step(s->loose, &tools, s->state == SESSION_RUNNING, passed_ns, cut, out);
    size_t size = (size_t)out->loose_count * sizeof *s->lay;
    s->loose_moves = memcmp(s->lay, out->loose, size) != 0;
    memcpy(s->lay, out->loose, size);
    return events;
}

// ---- jobs ---------------------------------------------------------------------------------------

static bool restoring_is_due(struct session *s, struct job *out_job) {
    for (int t = 0; t < s->scene->tissue_count; t++) {
        if (!s->to_restore[t] || s->job_out != JOB_NONE)
            continue;
        s->to_restore[t] = false;
        *out_job = (struct job){.kind = JOB_RESTORE, .tissue = t};
        return true;
    }
    return false;
}

// It takes back the last stroke that changed something: what is under way or waits lands before. A
// stroke in two tissues takes two jobs, and nothing is cut between.
static bool undoing_is_due(struct session *s, struct job *out_job) {
    if (!s->to_undo || s->job_out != JOB_NONE || cutting_waits(&s->cutting, s->undo_behind))
        return false;
    s->to_undo--;
    *out_job = (struct job){.kind = JOB_UNDO};
    return true;
}

// Returns whether a move is lost.
static bool watch_blades(struct session *s, const struct session_output *out) {
    if (s->state == SESSION_CLOSED)
        return cutting_drop_waiting(&s->cutting) > 0;
    if (s->state == SESSION_RUNNING)
        return cutting_watch(&s->cutting, s->scene, out) > 0;
    cutting_rest(&s->cutting);
    return false;
}

// At most one job is on its way, so that results land in the order of the cuts.
static void ask_for_job(struct session *s, struct session_output *out) {
    struct job *job = &out->job;
    out->events |= watch_blades(s, out) ? EVENT_REFUSED : 0;
    if (s->state == SESSION_CLOSED)
        return;
    bool due = restoring_is_due(s, job) || undoing_is_due(s, job);
    if (!due && s->job_out == JOB_NONE && cutting_take(&s->cutting, job))
        due = s->touched[job->tissue] = true;
    if (!due)
        return;
    job->id = ++s->last_job;
    s->job_out = job->kind;
    s->stroke_out = job->stroke;
}

// ---- jobs of elsewhere --------------------------------------------------------------------------

void session_take_over(struct session *s) {
    s->is_taken_over = true;
    cutting_rest(&s->cutting);
    cutting_drop_waiting(&s->cutting);
}

void session_go_on(struct session *s) {
    s->is_taken_over = false;
}

bool session_take_job(struct session *s, const struct job *job) {
    bool is_out = s->job_out != JOB_NONE;
    if (is_out && job->id == s->last_job && job->kind == s->job_out)
        return true;
    if (!s->is_taken_over || is_out || job->id <= s->last_job ||
        !job_is_valid(job, s->scene->tissue_count, &s->settings.instruments))
        return false;
    s->last_job = job->id;
    s->job_out = job->kind;
    s->stroke_out = job->stroke;
    if (job->kind == JOB_CUT)
        s->touched[job->tissue] = true;
    if (job->kind == JOB_RESTORE)
        s->to_restore[job->tissue] = false;
    if (job->kind == JOB_UNDO)
        s->to_undo -= s->to_undo > 0;
    if (job->kind == JOB_CUT && job->stroke > s->cutting.stroke_count)
        s->cutting.stroke_count = job->stroke;
    return true;
}

void session_void_job(struct session *s, int tissue) {
    s->to_restore[tissue] = true;
    s->touched[tissue] = false;
}

// ---- the step -----------------------------------------------------------------------------------

static bool shows_instruments(const struct session *s) {
    return s->state == SESSION_RUNNING ||
           (s->state == SESSION_PAUSED && s->settings.rules >= RULES_SHOWN_WHILE_PAUSED);
}

void session_step(struct session *s, const struct session_input *input,
                  struct session_output *out) {
    int64_t before_ns = s->time_ns;
    memset(out, 0, sizeof *out);
    out->events = take_input(s, input, &out->landed);
    out->step = ++s->step;
    out->frame_number = input->kind == INPUT_FRAME ? input->frame.number : 0;
    out->time_ns = s->time_ns;
    out->state = s->state;
    out->described = s->settings.instruments.count - INSTRUMENTS_USUAL;
    step_bones_place(&s->samples, s->scene->knee, out);
    correct_bones(s, out);
    if (shows_instruments(s))
        out->events |= move_instruments(s, s->time_ns - before_ns, out);
    else
        memset(s->seen, 0, sizeof s->seen);
    if (s->loose)
        out->events |= move_loose(s, s->time_ns - before_ns, out);
    if (!s->is_taken_over)
        ask_for_job(s, out);
    s->hash = output_hash(s->hash, out, s->settings.rules);
    out->hash = s->hash;
}
