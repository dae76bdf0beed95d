#include "property/busy_hands.h"

#include "base/clock.h"
#include "step/scene_parts.h"

#define STEP_NS (10 * NS_PER_MS)
#define GRASPER (CHANNEL_FIRST_DESCRIBED - CHANNEL_FIRST_INSTRUMENT)

static vec3 on_tissue(const struct scene *scene, struct random *r) {
    int tissue = (int)(random_bits(r) % (uint64_t)scene->tissue_count);
    const struct mesh *mesh = &scene->knee->groups[scene->tissues[tissue].group].mesh;
    vec3 p = mesh_vertex(mesh, (uint32_t)(random_bits(r) % mesh->vertex_count));
    return vec3_add(p, random_in_box(r, 1.5));
}

static vec3 on_loose(const struct scene *scene, struct random *r) {
    const struct case_loose *loose =
        &scene->knee->loose[random_bits(r) % (uint64_t)scene->knee->loose_count];
    return vec3_add(loose->at, random_in_box(r, 3));
}

static void move(struct busy_hands *h, int tool) {
    struct random *r = &h->random;
    vec3 way = vec3_sub(h->targets[tool], h->tips[tool]);
    double length = vec3_length(way), most = random_between(r, 0, 0.8);
    if (length < 0.5)
        h->targets[tool] = tool == GRASPER ? on_loose(h->scene, r) : on_tissue(h->scene, r);
    h->tips[tool] = vec3_add_scaled(h->tips[tool], length > most ? most / length : 1, way);
    h->openings[tool] += h->closing[tool];
    if (h->openings[tool] < 0 || h->openings[tool] > 1)
        h->closing[tool] = -h->closing[tool];
    h->openings[tool] = fmin(fmax(h->openings[tool], 0), 1);
}

struct busy_hands busy_hands_begin(const struct scene *scene, uint64_t seed) {
    struct busy_hands h = {.scene = scene, .random = {seed}, .flexion_deg = 30};
    for (int i = 0; i < INSTRUMENT_COUNT; i++) {
        h.tips[i] = h.targets[i] = on_tissue(scene, &h.random);
        h.closing[i] = random_between(&h.random, 0.02, 0.1);
    }
    return h;
}

static void add(struct session_input *input, struct sample sample) {
    sample.time_ns = input->time_ns;
    input->frame.samples[input->frame.count++] = sample;
}

static void hold(struct busy_hands *h, int tool, struct session_input *input) {
    enum channel channel = (enum channel)(CHANNEL_FIRST_INSTRUMENT + tool);
    pose T = {quat_from_axis_angle((vec3){1, 0, 0}, 1.4), h->tips[tool]};
    move(h, tool);
    add(input, (struct sample){.channel = channel, .kind = SAMPLE_POSE, .T_mockup_body = T});
    add(input, (struct sample){.channel = channel,
                               .kind = SAMPLE_HANDLE,
                               .handle = {h->openings[tool], h->runs ? 7 : 0}});
}

static void next_frame(struct busy_hands *h, struct session_input *input) {
    static const int tools[] = {0, CHANNEL_PUNCH - CHANNEL_FIRST_INSTRUMENT,
                                CHANNEL_SHAVER - CHANNEL_FIRST_INSTRUMENT, GRASPER};
    struct random *r = &h->random;
    *input = (struct session_input){.kind = INPUT_FRAME, .time_ns = h->time_ns};
    input->frame = (struct frame){.number = ++h->number, .time_ns = h->time_ns};
    h->flexion_deg = fmin(fmax(h->flexion_deg + random_between(r, -0.5, 0.5), 0), 90);
    add(input, (struct sample){.channel = CHANNEL_JOINT,
                               .kind = SAMPLE_JOINT,
                               .joint = {.flexion_deg = h->flexion_deg}});
    for (size_t i = 0; i < sizeof tools / sizeof *tools; i++)
        if (random_bits(r) % 50)
            hold(h, tools[i], input);
    if (random_bits(r) % 60 == 0)
        h->runs = !h->runs;
}

void busy_hands_next(struct busy_hands *h, const struct session_output *last,
                     const struct job_result *pending, struct session_input *out) {
    struct random *r = &h->random;
    h->time_ns += STEP_NS;
    if (pending && random_bits(r) % 3 == 0) {
        *out =
            (struct session_input){.kind = INPUT_JOB, .time_ns = h->time_ns, .job = pending->job};
        return;
    }
    next_frame(h, out);
    uint64_t chance = random_bits(r) % 700;
    if (last->state != SESSION_RUNNING)
        out->kind = chance < 60 ? INPUT_START : chance < 100 ? INPUT_EMPTY : out->kind;
    else if (chance < 8)
        out->kind = chance == 0 ? INPUT_RESET : chance == 1 ? INPUT_PAUSE : INPUT_UNDO;
}
