// A hub whose session cuts faster than its jobs are done: what stations are told is what was cut.
#include "base/clock.h"
#include "hub/seat.h"
#include "hub/tissue_delta.h"
#include "net/authority.h"
#include "test.h"
#include "trace/replay.h"
#include "unit/case_knee.h"

#include <stdio.h>
#include <time.h>

#define FRAMES 400
#define BURST 40

static char dir[FOLDER_MAX];

// ---- a hub --------------------------------------------------------------------------------------

static int make_house(void **state) {
    (void)state;
    static const char *const hosts[] = {"localhost"};
    char folder[256];
    struct knee_case *knee = box_knee();
    folder_make(dir);
    snprintf(folder, sizeof folder, "%s/keys", dir);
    enum result made = authority_init(folder, hosts, 1, NULL);
    snprintf(folder, sizeof folder, "%s/case", dir);
    enum result saved = case_save(knee, folder, NULL);
    case_destroy(&knee);
    return made == RESULT_OK && saved == RESULT_OK ? 0 : -1;
}

static int remove_house(void **state) {
    (void)state;
    folder_remove(dir);
    return 0;
}

static struct hub *open_hub(void) {
    static struct hub_config config;
    struct hub *hub;
    struct error err;
    config = (struct hub_config){
        .address = "127.0.0.1", .workers = 1, .wait_s = 60, .case_count = 2, .station_count = 1};
    config.settings = session_settings_default();
    snprintf(config.keys_dir, sizeof config.keys_dir, "%s/keys", dir);
    snprintf(config.traces_dir, sizeof config.traces_dir, "%s/traces", dir);
    snprintf(config.socket, sizeof config.socket, "%s/s", dir);
    for (int i = 0; i < 2; i++) {
        snprintf(config.cases[i].name, sizeof config.cases[i].name, "boxes%d", i);
        snprintf(config.cases[i].dir, sizeof config.cases[i].dir, "%s/case", dir);
    }
    config.stations[0].optic = view_optic_usual();
    snprintf(config.stations[0].name, sizeof config.stations[0].name, "room-1");
    snprintf(config.stations[0].case_name, sizeof config.stations[0].case_name, "boxes0");
    if (hub_create(&config, &hub, &err) != RESULT_OK)
        fail_msg("%s", err.text);
    return hub;
}

static void wait_ms(long ms) {
    nanosleep(&(struct timespec){ms / 1000, ms % 1000 * NS_PER_MS}, NULL);
}

// ---- a station that is not there: what is sent to it goes nowhere -------------------------------

static const struct control_peer nobody = {CONTROL_PEERS_MAX - 1, UINT32_MAX};

static void tell(struct hub *hub, struct note note) {
    note.peer = nobody;
    while (!worker_tell(&hub->workers[0], hub->workers[0].from_control, &note))
        wait_ms(1);
}

static void join(struct hub *hub) {
    struct seat *seat = &hub->seats[0];
    tell(hub, (struct note){.kind = NOTE_JOINED});
    tell(hub, (struct note){.kind = NOTE_CLOCK});
    pthread_mutex_lock(&hub->card_lock);
    seat->card.connected = true;
    desk_call(hub);
    pthread_mutex_unlock(&hub->card_lock);
    while (atomic_load(&seat->counts.state) != SESSION_RUNNING)
        wait_ms(1);
}

static void leave(struct hub *hub) {
    pthread_mutex_lock(&hub->card_lock);
    hub->seats[0].card.connected = false;
    pthread_mutex_unlock(&hub->card_lock);
}

static const arthron_CommandReply *command(struct hub *hub, arthron_Command_Kind kind) {
    static arthron_CommandReply reply;
    arthron_Command command = {.kind = kind, .station = "room-1", .case_name = "boxes1"};
    desk_command(hub, "otto", &command, &reply);
    assert_true(reply.ok);
    return &reply;
}

// A running burr on its way along the meniscus.
static void send_frame(struct hub *hub, vec3 tip) {
    static uint64_t number;
    int64_t now_ns = clock_now_ns();
    struct note note = {.kind = NOTE_FRAME, .received_ns = now_ns};
    note.frame = (struct frame){.number = ++number, .time_ns = now_ns, .count = 2};
    note.frame.samples[0] = (struct sample){.channel = CHANNEL_SHAVER,
                                            .kind = SAMPLE_POSE,
                                            .time_ns = now_ns,
                                            .T_mockup_body = {quat_identity(), tip}};
    note.frame.samples[1] = (struct sample){
        .channel = CHANNEL_SHAVER, .kind = SAMPLE_HANDLE, .time_ns = now_ns, .handle = {0, 1}};
    tell(hub, note);
}

static struct card card_of(struct hub *hub) {
    pthread_mutex_lock(&hub->card_lock);
    struct card card = hub->seats[0].card;
    pthread_mutex_unlock(&hub->card_lock);
    return card;
}

// In bursts, so that there is always more to be cut when a job is done; on a busy machine they wait
// for every second cut.
static void shave(struct hub *hub) {
    for (int i = 1; i <= FRAMES; i++) {
        send_frame(hub, (vec3){-19, -14 + 28.0 * i / FRAMES, -11});
        if (i % BURST)
            continue;
        wait_ms(20);
        for (int k = 0; k < 200 && (int)card_of(hub).tissues[0].cuts < i / BURST / 2; k++)
            wait_ms(20);
    }
}

// When nothing has come for a while. Tells too early only that the mesh has another number.
static struct card last_card(struct hub *hub) {
    struct card last = card_of(hub);
    for (int quiet = 0; quiet < 20; quiet++) {
        wait_ms(20);
        struct card now = card_of(hub);
        if (now.tissues[0].mesh_number != last.tissues[0].mesh_number)
            quiet = 0;
        last = now;
    }
    return last;
}

// ---- what was cut, by the session's own record --------------------------------------------------

static struct scene *load_scene(void) {
    struct case_limits limits = case_limits_default();
    struct knee_case *knee;
    struct scene *scene;
    char folder[256];
    snprintf(folder, sizeof folder, "%s/case", dir);
    assert_int_equal(case_load(folder, &limits, &knee, NULL), RESULT_OK);
    assert_int_equal(scene_create(&knee, &scene, NULL), RESULT_OK);
    return scene;
}

static uint64_t hash_of(const struct cut_mesh *mesh) {
    struct tissue tissue = {0};
    struct mesh_delta whole;
    tissue_delta_whole(mesh, &whole);
    whole.number = 1;
    assert_int_equal(tissue_change(&tissue, &whole, NULL), RESULT_OK);
    uint64_t hash = tissue.hash;
    mesh_delta_fini(&whole);
    tissue_fini(&tissue);
    return hash;
}

static void assert_was_cut(const struct card *card) {
    struct trace_reader *reader;
    static struct trace_record record;
    struct session_output output;
    struct scene *scene = load_scene();
    assert_int_equal(trace_reader_create(card->trace, &reader, NULL), RESULT_OK);
    struct rerun *rerun = rerun_create(scene, &trace_reader_header(reader)->settings);
    while (trace_read(reader, &record, NULL) == RESULT_OK)
        if (record.type == TRACE_STEP)
            rerun_step(rerun, &record, &output);
    const struct operation *operation = rerun_operation(rerun);
    assert_int_equal(card->tissues[0].mesh_number, operation_figures(operation, 0)->mesh_number);
    assert_int_equal(card->mesh_hashes[0], hash_of(operation_mesh(operation, 0)));
    rerun_destroy(&rerun);
    trace_reader_destroy(&reader);
    scene_destroy(&scene);
}

// ---- the tests ----------------------------------------------------------------------------------

static void a_job_that_is_asked_for_as_another_lands_does_not_overtake_it(void **state) {
    (void)state;
    struct hub *hub = open_hub();
    join(hub);
    shave(hub);
    command(hub, arthron_Command_Kind_PAUSE);
    struct card card = last_card(hub);
    hub_destroy(&hub);
    assert_true(card.tissues[0].cuts >= 5);
    assert_was_cut(&card);
}

static void a_reset_while_a_cut_is_on_its_way_makes_the_mesh_whole(void **state) {
    (void)state;
    struct hub *hub = open_hub();
    join(hub);
    uint64_t whole = last_card(hub).mesh_hashes[0];
    for (int i = 0; i < 3; i++) {
        shave(hub);
        command(hub, arthron_Command_Kind_RESET);
    }
    command(hub, arthron_Command_Kind_PAUSE);
    struct card card = last_card(hub);
    hub_destroy(&hub);
    assert_int_equal(card.tissues[0].cuts, 0);
    assert_int_equal(card.mesh_hashes[0], whole);
    assert_was_cut(&card);
}

static void what_was_cut_is_not_told_of_another_case(void **state) {
    (void)state;
    struct hub *hub = open_hub();
    join(hub);
    shave(hub);
    assert_true(last_card(hub).tissues[0].cuts > 0);
    leave(hub);
    command(hub, arthron_Command_Kind_CASE);
    const arthron_CommandReply *reply = command(hub, arthron_Command_Kind_SHOW);
    assert_string_equal(reply->sessions[0].case_name, "boxes1");
    assert_int_equal(reply->resections_count, 1);
    assert_int_equal(reply->resections[0].cuts, 0);
    hub_destroy(&hub);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_job_that_is_asked_for_as_another_lands_does_not_overtake_it),
        cmocka_unit_test(a_reset_while_a_cut_is_on_its_way_makes_the_mesh_whole),
        cmocka_unit_test(what_was_cut_is_not_told_of_another_case),
    };
    return cmocka_run_group_tests_name("theatre", tests, make_house, remove_house);
}
