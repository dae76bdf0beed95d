#include "cut_session.h"

#include "base/check.h"
#include "base/clock.h"
#include "folder.h"
#include "generate/generate.h"
#include "link/link.h"
#include "net/authority.h"
#include "samples.h"
#include "sessions/sessions.h"

#include <arpa/inet.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

#define FRAME_NS (2 * NS_PER_MS)
#define STATION "bench"

// ---- a hand that bites along the inner margin ---------------------------------------------------

#define PLACES 64

struct hand {
    pose places[PLACES]; // of the punch's tip, the jaw astride the margin
    vec3 margin;         // of the first place
};

static vec3 maxcut_of(const struct case_group *group, uint32_t vertex) {
    const float *to = group->maxcut + 3 * (size_t)vertex;
    return (vec3){(double)to[0], (double)to[1], (double)to[2]};
}

static pose place_at(const struct case_group *group, uint32_t vertex) {
    vec3 to = maxcut_of(group, vertex), up = {0, 0, 1};
    vec3 out = vec3_unit_or((vec3){to.x, to.y, 0}, (vec3){1, 0, 0}), x = vec3_cross(up, out);
    mat3 axes = {{{x.x, up.x, out.x}, {x.y, up.y, out.y}, {x.z, up.z, out.z}}};
    vec3 tip = vec3_add_scaled(mesh_vertex(&group->mesh, vertex), 2.0, out);
    return (pose){quat_from_mat3(axes), vec3_add(tip, (vec3){0, 0, -0.5})};
}

// The vertices that a whole resection moves farthest, well apart from each other.
static void choose_places(const struct case_group *group, struct hand *hand) {
    bool *used = alloc(group->mesh.vertex_count, sizeof *used);
    for (int i = 0; i < PLACES; i++) {
        uint32_t best = 0;
        double farthest = -1;
        for (uint32_t v = 0; v < group->mesh.vertex_count; v++) {
            double length = vec3_length(maxcut_of(group, v));
            if (!used[v] && length > farthest) {
                farthest = length;
                best = v;
            }
        }
        vec3 here = mesh_vertex(&group->mesh, best);
        hand->margin = i ? hand->margin : here;
        hand->places[i] = place_at(group, best);
        for (uint32_t v = 0; v < group->mesh.vertex_count; v++)
            used[v] |= vec3_distance(here, mesh_vertex(&group->mesh, v)) < 0.7;
    }
    free(used);
}

static void add(struct frame *frame, struct sample sample) {
    sample.time_ns = frame->time_ns;
    frame->samples[frame->count++] = sample;
}

static struct frame frame_of(uint64_t number, int64_t time_ns, pose punch, double opening,
                             vec3 probe) {
    struct frame frame = {.number = number, .time_ns = time_ns};
    add(&frame,
        (struct sample){.channel = CHANNEL_PUNCH, .kind = SAMPLE_POSE, .T_mockup_body = punch});
    add(&frame,
        (struct sample){.channel = CHANNEL_PUNCH, .kind = SAMPLE_HANDLE, .handle = {opening, 0}});
    add(&frame, (struct sample){.channel = CHANNEL_PROBE,
                                .kind = SAMPLE_POSE,
                                .T_mockup_body = {quat_identity(), probe}});
    return frame;
}

// Open for half a second, closing in 0.2 s, closed for the rest.
static double opening_at(int64_t in_second_ns) {
    double s = (double)in_second_ns / NS_PER_S;
    return s < 0.5 ? 1 : fmax(0, 1 - (s - 0.5) / 0.2);
}

static enum result healthy_knee(struct knee_case **out_knee, struct error *err) {
    struct recipe recipe;
    enum result result = recipe_load(CASES "/healthy", &recipe, err);
    return result == RESULT_OK ? generate_knee(&recipe, out_knee, err) : result;
}

// ---- what a hand feels --------------------------------------------------------------------------

struct felt {
    double over_bound; // the largest change for the sake of a cut, over what is allowed
    double change_mm;  // the largest in one step
    double sum_mm;
};

struct play {
    struct session *session;
    struct operation *operation;
    struct job_result *pending;
    struct session_output out;
};

static void step(struct play *play, const struct session_input *input) {
    session_step(play->session, input, &play->out);
    if (!play->out.job.id)
        return;
    job_result_destroy(&play->pending);
    play->pending = operation_run(play->operation, &play->out.job);
}

static void land(struct play *play, int64_t time_ns) {
    struct job_result *result = play->pending;
    play->pending = NULL;
    step(play, &(struct session_input){
                   .kind = INPUT_JOB, .time_ns = time_ns, .job = result->job, .result = result});
    job_result_destroy(&result);
}

// The probe rests in the first half of each second; then it goes to and fro between two points, so
// that every other step it is where it was: what differs there is the cuts' doing alone.
static vec3 probe_at(const struct hand *hand, int frame) {
    vec3 p = hand->margin;
    if (frame % 500 >= 250 && frame % 2)
        p.x += 0.1;
    return p;
}

static void feel(const struct scene *scene, const struct hand *hand, double ease_mm_s, int seconds,
                 struct felt *felt) {
    struct session_settings settings = session_settings_default();
    settings.ease_mm_s = ease_mm_s;
    struct play play = {session_create(scene, &settings),
                        operation_create(scene, settings.rules, instruments_usual()),
                        NULL,
                        {0}};
    step(&play, &(struct session_input){.kind = INPUT_START});
    vec3 before[2] = {{0}};
    double allowed[2] = {0};
    *felt = (struct felt){0};
    for (int i = 0; i < seconds * 500; i++) {
        struct session_input input = {.kind = INPUT_FRAME, .time_ns = (int64_t)i * FRAME_NS};
        vec3 probe = probe_at(hand, i);
        double way = i ? vec3_distance(probe, probe_at(hand, i - 1)) : 0;
        if (play.pending)
            land(&play, input.time_ns);
        input.frame = frame_of((uint64_t)i + 1, input.time_ns, hand->places[i / 500 % PLACES],
                               opening_at(input.time_ns % NS_PER_S), probe);
        step(&play, &input);
        vec3 now = play.out.instruments[0].warp.displacement;
        double allow = settings.ease_share * way + ease_mm_s * FRAME_NS / NS_PER_S;
        double change = vec3_distance(now, before[i % 2]);
        bool was_here = i > 1 && vec3_distance(probe, probe_at(hand, i - 2)) == 0;
        if (was_here) {
            felt->over_bound = fmax(felt->over_bound, change / (allow + allowed[(i + 1) % 2]));
            felt->change_mm = fmax(felt->change_mm, change);
            felt->sum_mm += change / 2;
        }
        before[i % 2] = now;
        allowed[i % 2] = allow;
    }
    session_destroy(&play.session);
    operation_destroy(&play.operation);
    job_result_destroy(&play.pending);
}

static enum result bench_feel(const struct bench_options *options, struct report *report,
                              struct error *err) {
    struct knee_case *knee;
    struct scene *scene;
    enum result result = healthy_knee(&knee, err);
    if (result == RESULT_OK && (result = scene_create(&knee, &scene, err)) != RESULT_OK)
        case_destroy(&knee);
    if (result != RESULT_OK)
        return result;
    struct hand hand;
    choose_places(&scene_case(scene)->groups[scene_tissue_group(scene, 0)], &hand);
    int seconds = options->quick ? 4 : 20;
    struct felt eased, sudden;
    feel(scene, &hand, session_settings_default().ease_mm_s, seconds, &eased);
    feel(scene, &hand, 1e6, seconds, &sudden);
    scene_destroy(&scene);
    report_mark(report, "jump_over_easing_bound", eased.over_bound, "ratio", 1, BETTER_LOW);
    report_figure(report, eased.change_mm, "mm in two frames", "jump/eased");
    report_figure(report, sudden.change_mm, "mm in two frames", "jump/sudden");
    report_figure(report, eased.sum_mm, "mm", "jump/moved in all");
    return RESULT_OK;
}

// ---- what poses beside it cost ------------------------------------------------------------------

struct rig {
    char dir[FOLDER_MAX], keys[128], case_dir[128], station_keys[128];
    struct sessions_config config;
    struct session_station station;
    struct sessions *sessions;
    struct link *link;
    struct hand hand;
    uint64_t frame;
    uint64_t cuts;
};

static int free_port(void) {
    struct sockaddr_in address = {.sin_family = AF_INET, .sin_addr = {htonl(INADDR_LOOPBACK)}};
    socklen_t size = sizeof address;
    int fd = socket(AF_INET, SOCK_STREAM, 0);
    bool bound = fd >= 0 && !bind(fd, (struct sockaddr *)&address, sizeof address) &&
                 !getsockname(fd, (struct sockaddr *)&address, &size);
    CHECK(bound);
    close(fd);
    return ntohs(address.sin_port);
}

static enum result save_case(struct rig *h, struct error *err) {
    struct knee_case *knee;
    enum result result = healthy_knee(&knee, err);
    if (result != RESULT_OK)
        return result;
    choose_places(case_group(knee, "meniscus_medial"), &h->hand);
    result = case_save(knee, h->case_dir, err);
    case_destroy(&knee);
    return result;
}

static void fill_config(struct rig *h) {
    struct sessions_config *c = &h->config;
    *c = (struct sessions_config){.address = "127.0.0.1",
                                  .port = free_port(),
                                  .workers = 1,
                                  .wait_s = 30,
                                  .calibration_days = 90,
                                  .settings = session_settings_default(),
                                  .case_count = 1,
                                  .station_count = 1};
    snprintf(c->keys_dir, sizeof c->keys_dir, "%s", h->keys);
    snprintf(c->traces_dir, sizeof c->traces_dir, "%s/traces", h->dir);
    snprintf(c->socket, sizeof c->socket, "%s/socket", h->dir);
    snprintf(c->cases[0].name, sizeof c->cases[0].name, "healthy");
    snprintf(c->cases[0].dir, sizeof c->cases[0].dir, "%s", h->case_dir);
    c->stations = &h->station;
    c->stations[0].optic = view_optic_usual();
    snprintf(c->stations[0].name, sizeof c->stations[0].name, STATION);
    snprintf(c->stations[0].case_name, sizeof c->stations[0].case_name, "healthy");
}

static enum result enrol(struct rig *h, struct error *err) {
    char code[AUTHORITY_CODE_MAX];
    enum result result = authority_issue_code(h->keys, STATION, code, err);
    if (result == RESULT_OK)
        result = link_enrol("127.0.0.1", h->config.port, code, STATION, h->station_keys, err);
    return result;
}

static enum result open_rig(struct rig *h, struct error *err) {
    static const atomic_bool never;
    const char *host = "127.0.0.1";
    folder_make(h->dir);
    snprintf(h->keys, sizeof h->keys, "%s/keys", h->dir);
    snprintf(h->case_dir, sizeof h->case_dir, "%s/case", h->dir);
    snprintf(h->station_keys, sizeof h->station_keys, "%s/station", h->dir);
    enum result result = save_case(h, err);
    fill_config(h);
    if (result == RESULT_OK)
        result = authority_init(h->keys, &host, 1, err);
    if (result == RESULT_OK)
        result = sessions_create(&h->config, &never, &h->sessions, err);
    if (result == RESULT_OK)
        result = enrol(h, err);
    struct link_config link = {.server_count = 1,
                               .servers = {{.port = h->config.port}},
                               .keys_dir = h->station_keys,
                               .station = STATION,
                               .software = "arthron-bench",
                               .datagrams = true,
                               .device_count = 1,
                               .devices = {{"hand", "simulated"}}};
    snprintf(link.servers[0].host, sizeof link.servers[0].host, "%s", host);
    return result == RESULT_OK ? link_create(&link, &h->link, err) : result;
}

static void close_rig(struct rig *h) {
    if (h->link)
        link_destroy(&h->link);
    if (h->sessions)
        sessions_destroy(&h->sessions);
    folder_remove(h->dir);
}

static void sleep_until(int64_t time_ns) {
    struct timespec until = {time_ns / NS_PER_S, time_ns % NS_PER_S};
    clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &until, NULL);
}

// Frames at 500 Hz for so long; round trips in us.
static void ride(struct rig *h, double seconds, bool cutting, struct samples *out_us) {
    int64_t start_ns = clock_now_ns(), end_ns = start_ns + (int64_t)(seconds * NS_PER_S);
    for (int64_t due_ns = start_ns; due_ns < end_ns; due_ns += FRAME_NS) {
        sleep_until(due_ns);
        int64_t now_ns = clock_now_ns();
        size_t place = (size_t)(now_ns / NS_PER_S) % PLACES;
        double opening = cutting ? opening_at(now_ns % NS_PER_S) : 1;
        struct frame frame =
            frame_of(++h->frame, now_ns, h->hand.places[place], opening, h->hand.margin);
        arthron_Reply reply;
        if (!link_send(h->link, &frame))
            continue;
        while (link_wait(h->link, now_ns + 500 * NS_PER_MS, &reply)) {
            h->cuts += (reply.events & EVENT_CUT) != 0;
            if (reply.frame_number == h->frame)
                break;
        }
        samples_add(out_us, 1e-3 * (double)(clock_now_ns() - now_ns));
    }
}

static enum result wait_for_path(struct rig *h, struct error *err) {
    struct link_status status;
    for (int i = 0; i < 100; i++) {
        struct samples warm = {0};
        ride(h, 0.1, false, &warm);
        samples_fini(&warm);
        link_get_status(h->link, &status);
        if (status.path == LINK_DATAGRAM)
            return RESULT_OK;
    }
    return fail(err, RESULT_TIMEOUT, "no datagram path to a server on this machine");
}

static void compare(struct rig *h, const struct bench_options *options, struct report *report) {
    int rounds = options->quick ? 4 : 10;
    double seconds = options->quick ? 2 : 5;
    struct samples ratios = {0}, all[2] = {{0}, {0}};
    for (int i = 0; i < rounds; i++) {
        double p999[2];
        for (int k = 0; k < 2; k++) {
            bool cutting = k != i % 2; // the order alternates too
            struct samples us = {0};
            ride(h, seconds, cutting, &us);
            p999[cutting] = samples_quantile(&us, 0.999);
            for (size_t s = 0; s < us.count; s++)
                samples_add(&all[cutting], us.values[s]);
            samples_fini(&us);
        }
        samples_add(&ratios, p999[1] / p999[0]);
    }
    report_mark(report, "pose_p999_cutting_over_idle", samples_quantile(&ratios, 0.5), "ratio", 1.5,
                BETTER_LOW);
    static const char *const names[] = {"idle", "cutting"};
    for (int k = 0; k < 2; k++) {
        report_figure(report, samples_quantile(&all[k], 0.5), "us", "pose/%s/p50", names[k]);
        report_figure(report, samples_quantile(&all[k], 0.99), "us", "pose/%s/p99", names[k]);
        report_figure(report, samples_quantile(&all[k], 0.999), "us", "pose/%s/p999", names[k]);
        report_figure(report, samples_max(&all[k]), "us", "pose/%s/max", names[k]);
        samples_fini(&all[k]);
    }
    report_figure(report, (double)h->cuts, "frames", "pose/cutting/with a cut that landed");
    samples_fini(&ratios);
}

static enum result bench_poses(const struct bench_options *options, struct report *report,
                               struct error *err) {
    struct rig rig = {0};
    enum result result = open_rig(&rig, err);
    if (result == RESULT_OK)
        result = wait_for_path(&rig, err);
    if (result == RESULT_OK)
        compare(&rig, options, report);
    close_rig(&rig);
    return result;
}

enum result bench_cut_session(const struct bench_options *options, struct report *report,
                              struct error *err) {
    enum result result = bench_feel(options, report, err);
    return result == RESULT_OK ? bench_poses(options, report, err) : result;
}
