#include "unit/hall.h"

#include "base/clock.h"
#include "net/authority.h"
#include "test.h"
#include "unit/case_knee.h"

#include <stdio.h>
#include <time.h>

#define FRAMES 400
#define BURST 40

char hall_dir[FOLDER_MAX];

// ---- a hub --------------------------------------------------------------------------------------

int hall_make(void **state) {
    (void)state;
    static const char *const hosts[] = {"localhost"};
    char folder[256];
    struct knee_case *knee = box_knee();
    folder_make(hall_dir);
    snprintf(folder, sizeof folder, "%s/keys", hall_dir);
    enum result made = authority_init(folder, hosts, 1, NULL);
    snprintf(folder, sizeof folder, "%s/case", hall_dir);
    enum result saved = case_save(knee, folder, NULL);
    case_destroy(&knee);
    return made == RESULT_OK && saved == RESULT_OK ? 0 : -1;
}

int hall_remove(void **state) {
    (void)state;
    folder_remove(hall_dir);
    return 0;
}

struct hub *hall_open(void) {
    static struct hub_config config;
    struct hub *hub;
    struct error err;
    config = (struct hub_config){
        .address = "127.0.0.1", .workers = 1, .wait_s = 60, .case_count = 2, .station_count = 1};
    config.settings = session_settings_default();
    snprintf(config.keys_dir, sizeof config.keys_dir, "%s/keys", hall_dir);
    snprintf(config.traces_dir, sizeof config.traces_dir, "%s/traces", hall_dir);
    snprintf(config.socket, sizeof config.socket, "%s/s", hall_dir);
    for (int i = 0; i < 2; i++) {
        snprintf(config.cases[i].name, sizeof config.cases[i].name, "boxes%d", i);
        snprintf(config.cases[i].dir, sizeof config.cases[i].dir, "%s/case", hall_dir);
    }
    config.stations[0].optic = (struct view_optic){.tilt_deg = 70, .field_deg = 105};
    snprintf(config.stations[0].name, sizeof config.stations[0].name, "room-1");
    snprintf(config.stations[0].case_name, sizeof config.stations[0].case_name, "boxes0");
    if (hub_create(&config, &hub, &err) != RESULT_OK)
        fail_msg("%s", err.text);
    return hub;
}

void hall_wait_ms(long ms) {
    nanosleep(&(struct timespec){ms / 1000, ms % 1000 * NS_PER_MS}, NULL);
}

// ---- a station that is not there: what is sent to it goes nowhere -------------------------------

static const struct control_peer nobody = {CONTROL_PEERS_MAX - 1, UINT32_MAX};

static void tell(struct hub *hub, struct note note) {
    note.peer = nobody;
    while (!worker_tell(&hub->workers[0], hub->workers[0].from_control, &note))
        hall_wait_ms(1);
}

void hall_join(struct hub *hub) {
    struct seat *seat = &hub->seats[0];
    tell(hub, (struct note){.kind = NOTE_JOINED});
    tell(hub, (struct note){.kind = NOTE_CLOCK});
    pthread_mutex_lock(&hub->card_lock);
    seat->card.connected = true;
    desk_call(hub);
    pthread_mutex_unlock(&hub->card_lock);
    while (atomic_load(&seat->counts.state) != SESSION_RUNNING)
        hall_wait_ms(1);
}

void hall_leave(struct hub *hub) {
    pthread_mutex_lock(&hub->card_lock);
    hub->seats[0].card.connected = false;
    pthread_mutex_unlock(&hub->card_lock);
}

const arthron_CommandReply *hall_command(struct hub *hub, arthron_Command_Kind kind) {
    static arthron_CommandReply reply;
    arthron_Command command = {.kind = kind, .station = "room-1", .case_name = "boxes1"};
    desk_command(hub, "otto", &command, &reply);
    assert_true(reply.ok);
    return &reply;
}

// A running burr on its way along the meniscus.
void hall_frame(struct hub *hub, vec3 tip) {
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

struct card hall_card(struct hub *hub) {
    pthread_mutex_lock(&hub->card_lock);
    struct card card = hub->seats[0].card;
    pthread_mutex_unlock(&hub->card_lock);
    return card;
}

void hall_shave(struct hub *hub) {
    hall_shave_part(hub, 0, 1);
}

// In bursts, so that there is always more to be cut when a job is done; on a busy machine they wait
// for every second cut.
void hall_shave_part(struct hub *hub, double from, double to) {
    for (int i = 1 + (int)(from * FRAMES); i <= to * FRAMES; i++) {
        hall_frame(hub, (vec3){-19, -14 + 28.0 * i / FRAMES, -11});
        if (i % BURST)
            continue;
        hall_wait_ms(20);
        for (int k = 0; k < 200 && (int)hall_card(hub).tissues[0].cuts < i / BURST / 2; k++)
            hall_wait_ms(20);
    }
}

// When nothing has come for a while. Tells too early only that the mesh has another number.
struct card hall_last_card(struct hub *hub) {
    struct card last = hall_card(hub);
    for (int quiet = 0; quiet < 20; quiet++) {
        hall_wait_ms(20);
        struct card now = hall_card(hub);
        if (now.tissues[0].mesh_number != last.tissues[0].mesh_number)
            quiet = 0;
        last = now;
    }
    return last;
}
