#include "scene/hand.h"

#include "generated.h"

struct scene *scene;
const struct case_group *meniscus;
vec3 inner, outward;
enum field_kind hand_field = FIELD_INTEGRAL;

uint32_t most_moved(const struct case_group *group) {
    uint32_t best = 0;
    double length = 0;
    for (uint32_t i = 0; i < group->mesh.vertex_count; i++) {
        const float *to = group->maxcut + 3 * (size_t)i;
        double l = hypot((double)to[0], (double)to[1]);
        if (l > length)
            best = i;
        length = fmax(l, length);
    }
    return best;
}

int hand_make_scene(void **state) {
    (void)state;
    struct error err;
    struct knee_case *knee = generated_knee(CASES "/healthy");
    if (scene_create(&knee, &scene, &err) != RESULT_OK)
        fail_msg("%s", err.text);
    meniscus = &scene_case(scene)->groups[scene_tissue_group(scene, 0)];
    uint32_t vertex = most_moved(meniscus);
    const float *to = meniscus->maxcut + 3 * (size_t)vertex;
    inner = mesh_vertex(&meniscus->mesh, vertex);
    outward = vec3_unit_or((vec3){(double)to[0], (double)to[1], 0}, (vec3){1, 0, 0});
    return 0;
}

int hand_drop_scene(void **state) {
    (void)state;
    scene_destroy(&scene);
    return 0;
}

// Along the meniscus' width, y up: a punch's jaw is astride the inner margin.
static pose tip_pose(vec3 tip) {
    vec3 up = {0, 0, 1}, x = vec3_cross(up, outward);
    mat3 axes = {{{x.x, up.x, outward.x}, {x.y, up.y, outward.y}, {x.z, up.z, outward.z}}};
    return (pose){quat_from_mat3(axes), tip};
}

struct hand hand_start(void) {
    struct session_settings settings = session_settings_default();
    settings.field.kind = hand_field;
    struct hand h = {.session = session_create(scene, &settings),
                     .operation = operation_create(scene, settings.rules, instruments_usual()),
                     .channel = CHANNEL_PUNCH,
                     .length = 1,
                     .opening = 1};
    h.tip = vec3_add(vec3_add_scaled(inner, 2.5, outward), (vec3){0, 0, -0.5});
    h.input.kind = INPUT_START;
    session_step(h.session, &h.input, &h.out);
    return h;
}

void hand_end(struct hand *h) {
    session_destroy(&h->session);
    operation_destroy(&h->operation);
    job_result_destroy(&h->pending);
}

void run_job(struct hand *h) {
    if (!h->out.job.id)
        return;
    assert_null(h->pending); // never two on their way
    h->pending = operation_run(h->operation, &h->out.job);
}

static quat scaled(quat q, double by) {
    return (quat){by * q.w, by * q.x, by * q.y, by * q.z};
}

static void add(struct hand *h, struct sample sample) {
    sample.time_ns = h->input.time_ns;
    if (sample.kind == SAMPLE_POSE)
        sample.T_mockup_body.rotation = scaled(sample.T_mockup_body.rotation, h->length);
    h->input.frame.samples[h->input.frame.count++] = sample;
}

void step(struct hand *h) {
    uint64_t number = h->input.kind == INPUT_FRAME ? h->input.frame.number : 0;
    h->input.kind = INPUT_FRAME;
    h->input.time_ns += STEP_NS;
    h->input.frame = (struct frame){.number = number + 1, .time_ns = h->input.time_ns};
    add(h, (struct sample){
               .channel = h->channel, .kind = SAMPLE_POSE, .T_mockup_body = tip_pose(h->tip)});
    add(h, (struct sample){.channel = h->channel,
                           .kind = SAMPLE_HANDLE,
                           .validity = h->handle,
                           .handle = {h->opening, h->buttons}});
    if (h->probe_is_there)
        add(h, (struct sample){.channel = CHANNEL_PROBE,
                               .kind = SAMPLE_POSE,
                               .T_mockup_body = {quat_identity(), h->probe}});
    if (h->knife_is_there)
        add(h, (struct sample){.channel = CHANNEL_KNIFE,
                               .kind = SAMPLE_POSE,
                               .T_mockup_body = tip_pose(h->knife)});
    if (h->tibia_is_tracked)
        add(h, (struct sample){.channel = CHANNEL_TIBIA,
                               .kind = SAMPLE_POSE,
                               .T_mockup_body = pose_identity()});
    session_step(h->session, &h->input, &h->out);
    run_job(h);
}

void give(struct hand *h, enum input_kind kind, uint64_t job, const struct job_result *result) {
    struct session_input input = {.kind = kind, .time_ns = h->input.time_ns};
    if (kind == INPUT_JOB) {
        input.job = job;
        input.result = result;
    }
    session_step(h->session, &input, &h->out);
}

struct landed land(struct hand *h) {
    assert_non_null(h->pending);
    struct job_result *result = h->pending;
    h->pending = NULL;
    give(h, INPUT_JOB, result->job, result);
    run_job(h);
    job_result_destroy(&result);
    return h->out.landed;
}

void close_to_job(struct hand *h) {
    while (!h->pending && h->opening > 0) {
        h->opening = fmax(0, h->opening - 0.05);
        step(h);
    }
}

struct landed bite(struct hand *h) {
    struct landed last = {0};
    h->opening = 1;
    step(h);
    while (h->opening > 0) {
        close_to_job(h);
        if (h->pending)
            last = land(h);
    }
    return last;
}
