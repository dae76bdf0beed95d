// A recorded session as arthron-trace serves it, read by clients of OpenIGTLink's own classes
// beside one that never reads.
#include "base/clock.h"
#include "replay/serve_expected.h"
#include "test.h"
#include "unit/library_poses.h"

#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

// ---- the program --------------------------------------------------------------------------------

struct program {
    pid_t pid;
    int port;
    FILE *log;
};

static struct program start(const char *speed, const char *loop) {
    const char *argv[] = {TRACE_PROGRAM, "serve", served_path, "--port", "0",
                          "--speed",     speed,   loop,        NULL};
    int pipes[2];
    assert_int_equal(0, pipe(pipes));
    struct program p = {.pid = fork()};
    if (!p.pid) {
        prctl(PR_SET_PDEATHSIG, SIGKILL);
        dup2(pipes[1], STDERR_FILENO);
        close(pipes[0]);
        close(pipes[1]);
        execv(TRACE_PROGRAM, (char *const *)argv);
        _exit(127);
    }
    close(pipes[1]);
    p.log = fdopen(pipes[0], "r");
    char line[256];
    const char *at = NULL;
    while (!at && fgets(line, sizeof line, p.log))
        at = strstr(line, "port ");
    assert_non_null(at);
    p.port = atoi(at + strlen("port "));
    return p;
}

// Its exit code once it has ended: of itself, or by the signal.
static int ended(struct program *p, int signal_number) {
    int status;
    if (signal_number)
        kill(p->pid, signal_number);
    assert_int_equal(p->pid, waitpid(p->pid, &status, 0));
    fclose(p->log);
    return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
}

static bool is(const struct library_message *m, const char *type) {
    return !strcmp(m->type, type);
}

static int next_of(struct library_client *client, const char *type, int from) {
    for (int i = from; i < library_client_count(client); i++) {
        struct library_message m = library_client_message(client, i);
        if (is(&m, type))
            return i;
    }
    return -1;
}

// Waits for a message of that type from the given place on.
static int awaited(struct library_client *client, const char *type, int from) {
    int64_t end_ns = clock_now_ns() + 30 * NS_PER_S;
    int found;
    while ((found = next_of(client, type, from)) < 0 && clock_now_ns() < end_ns)
        nanosleep(&(struct timespec){.tv_nsec = 2000000}, NULL);
    if (found < 0)
        fail_msg("no %s after %d messages", type, library_client_count(client));
    return found;
}

// ---- comparing ----------------------------------------------------------------------------------

// A stamp has 32 bits for the part of a second.
static bool same_time(int64_t a_ns, int64_t b_ns) {
    return llabs(a_ns - b_ns) <= 1;
}

static void assert_all_are_read(struct library_client *client) {
    for (int i = 0; i < library_client_count(client); i++) {
        struct library_message m = library_client_message(client, i);
        if (!m.read && !is(&m, "CAPABILITY"))
            fail_msg("the library cannot read %s of %s", m.type, m.device);
    }
}

static bool is_pose(const struct library_message *m, const struct expected_pose *p) {
    return !strcmp(m->device, p->name) && same_time(m->stamp_ns, p->stamp_ns);
}

// Whole sets of the record, in its order, up to the last one. On a busy machine the client is late
// and gets the newest, so some may be left out.
static void assert_transforms(struct library_client *client) {
    int found = 0, at = next_of(client, "TRANSFORM", 0);
    for (int k = 0; k < expected.set_count; k++) {
        const struct expected_set *set = &expected.sets[k];
        struct library_message m = library_client_message(client, at);
        if (!is_pose(&m, &set->poses[0]) && k + 1 < expected.set_count)
            continue;
        found++;
        for (int i = 0; i < set->count; i++) {
            m = library_client_message(client, at);
            if (!is_pose(&m, &set->poses[i]))
                fail_msg("set %d: %s at %lld instead of %s at %lld", k, m.device,
                         (long long)m.stamp_ns, set->poses[i].name,
                         (long long)set->poses[i].stamp_ns);
            assert_int_equal(m.version, 1);
            assert_library_matrix(&m.tools[0], set->poses[i].T);
            at = next_of(client, "TRANSFORM", at + 1);
            assert_true(at >= 0 || (i + 1 == set->count && k + 1 == expected.set_count));
        }
    }
    assert_int_equal(at, -1);
    assert_in_range(found, expected.set_count / 3, expected.set_count);
}

static const struct expected_set *set_at(int64_t stamp_ns, int *in_out_from) {
    for (; *in_out_from < expected.set_count; ++*in_out_from)
        if (same_time(expected.sets[*in_out_from].stamp_ns, stamp_ns))
            return &expected.sets[*in_out_from];
    fail_msg("no set has the stamp %lld, or it came twice", (long long)stamp_ns);
    return NULL;
}

// Those that came are sets of the record, in its order. Returns how many.
static int assert_sets(struct library_client *client, const char *type, int version,
                       void (*check)(const struct library_tool *tool, pose p)) {
    int from = 0, count = 0;
    for (int at = next_of(client, type, 0); at >= 0; at = next_of(client, type, at + 1)) {
        struct library_message m = library_client_message(client, at);
        const struct expected_set *set = set_at(m.stamp_ns, &from);
        from++;
        count++;
        assert_int_equal(m.version, version);
        assert_string_equal(m.device, "Arthron");
        assert_int_equal(m.tool_count, set->count);
        for (int i = 0; i < set->count; i++) {
            assert_string_equal(m.tools[i].name, set->poses[i].name);
            check(&m.tools[i], set->poses[i].T);
        }
    }
    return count;
}

static void assert_texts(struct library_client *client) {
    int at = -1;
    for (int i = 0; i < expected.text_count; i++) {
        at = next_of(client, "STRING", at + 1);
        assert_int_not_equal(at, -1);
        struct library_message m = library_client_message(client, at);
        assert_string_equal(m.device, expected.text_devices[i]);
        assert_true(same_time(m.stamp_ns, expected.text_stamps_ns[i]));
        assert_string_equal(m.text, expected.texts[i]);
    }
    assert_int_equal(next_of(client, "STRING", at + 1), -1);
}

// The newest state is what counts: one that lasts for a moment may be left out.
static void assert_states(struct library_client *client) {
    int state = -1, found = 0;
    for (int at = next_of(client, "STATUS", 0); at >= 0; at = next_of(client, "STATUS", at + 1)) {
        struct library_message m = library_client_message(client, at);
        do
            assert_in_range(++state, 0, expected.state_count - 1);
        while (strcmp(m.text, expected.states[state]) != 0);
        assert_int_equal(m.status, strcmp(m.text, "running") ? 13 : 1);
        found++;
    }
    assert_int_equal(state, expected.state_count - 1);
    assert_in_range(found, 2, expected.state_count);
}

static void assert_mesh(const struct library_message *m, const struct mesh *mesh) {
    assert_int_equal(m->point_count, mesh->vertex_count);
    assert_int_equal(m->triangle_count, mesh->triangle_count);
    assert_memory_equal(m->points, mesh->positions, 3 * sizeof(float) * mesh->vertex_count);
    assert_memory_equal(m->triangles, mesh->triangles, 3 * sizeof(uint32_t) * mesh->triangle_count);
}

// The medial meniscus before its first cut and after each of them; a client that is late gets the
// newest.
static void assert_meshes(struct library_client *client) {
    int mesh = -1, found = 0;
    for (int at = next_of(client, "POLYDATA", 0); at >= 0;
         at = next_of(client, "POLYDATA", at + 1)) {
        struct library_message m = library_client_message(client, at);
        if (strcmp(m.device, "meniscus_medial") != 0)
            continue;
        do
            assert_in_range(++mesh, 0, expected.mesh_count - 1);
        while (!same_time(m.stamp_ns, expected.mesh_stamps_ns[mesh]));
        assert_mesh(&m, &expected.meshes[mesh]);
        found++;
    }
    assert_int_equal(mesh, expected.mesh_count - 1);
    assert_in_range(found, 2, expected.mesh_count);
}

// ---- what they read -----------------------------------------------------------------------------

static void assert_granted(struct library_client *client, const char *answer) {
    int at = next_of(client, answer, 0);
    if (at < 0)
        fail_msg("no %s among %d messages", answer, library_client_count(client));
    assert_int_equal(library_client_message(client, at).status, 0);
}

static void all_that_was_recorded_arrives_beside_one_that_never_reads(void **state) {
    (void)state;
    struct program program = start("20", NULL);
    struct library_client *reads = library_client_start(program.port);
    struct library_client *deaf = library_client_start_deaf(program.port);
    struct library_client *tdata = library_client_start(program.port);
    struct library_client *qtdata = library_client_start(program.port);
    assert_true(reads && deaf && tdata && qtdata);
    assert_true(library_client_ask(tdata, 1, "STT_TDATA", "", 16));
    assert_true(library_client_ask(qtdata, 2, "STT_QTDATA", "", 16));
    expect_all();
    assert_int_equal(ended(&program, 0), 0);
    library_client_wait(reads);
    library_client_wait(tdata);
    library_client_wait(qtdata);
    assert_all_are_read(reads);
    assert_transforms(reads);
    assert_texts(reads);
    assert_states(reads);
    assert_meshes(reads);
    assert_granted(tdata, "RTS_TDATA");
    assert_granted(qtdata, "RTS_QTDATA");
    assert_in_range(assert_sets(tdata, "TDATA", 1, assert_library_matrix), 10, expected.set_count);
    assert_in_range(assert_sets(qtdata, "QTDATA", 2, assert_library_quaternion), 10,
                    expected.set_count);
    library_client_end(reads);
    library_client_end(tdata);
    library_client_end(qtdata);
    library_client_end(deaf);
}

// ---- what they ask ------------------------------------------------------------------------------

static struct library_client *connected(int port) {
    struct library_client *client = library_client_start(port);
    assert_non_null(client);
    for (int at = 0;; at++) {
        at = awaited(client, "TRANSFORM", at);
        if (!strcmp(library_client_message(client, at).device, "virtual_tibia"))
            return client;
    }
}

// The first answer of that version from the given place on.
static struct library_message answer(struct library_client *client, int version, const char *get,
                                     const char *device, const char *type) {
    int at = library_client_count(client);
    struct library_message m;
    assert_true(library_client_ask(client, version, get, device, 0));
    do {
        at = awaited(client, type, at);
        m = library_client_message(client, at++);
    } while (m.version != version || strcmp(m.device, device) != 0);
    assert_true(m.read);
    return m;
}

// A client that asked for TDATA once a minute gets a TRANSFORM only if it asks.
static void what_is_asked_for_is_answered_in_the_version_of_the_question(void **state) {
    (void)state;
    struct program program = start("0.5", "--loop");
    struct library_client *client = connected(program.port); // has all poses
    assert_true(library_client_ask(client, 1, "STT_TDATA", "", 60000));
    awaited(client, "RTS_TDATA", 0);
    for (int version = 1; version <= 3; version++) {
        int before = library_client_count(client);
        struct library_message m =
            answer(client, version, "GET_TRANS", "virtual_tibia", "TRANSFORM");
        int set = 0;
        while (set < expected.set_count &&
               !same_time(expected.sets[set].poses[3].stamp_ns, m.stamp_ns))
            set++;
        assert_in_range(set, 0, expected.set_count - 1);
        assert_string_equal(expected.sets[set].poses[3].name, "virtual_tibia");
        assert_library_matrix(&m.tools[0], expected.sets[set].poses[3].T);
        assert_true(answer(client, version, "GET_TDATA", "Arthron", "TDATA").tool_count >= 6);
        assert_true(answer(client, version, "GET_QTDATA", "Arthron", "QTDATA").tool_count >= 6);
        m = answer(client, version, "GET_POLYDATA", "meniscus_medial", "POLYDATA");
        assert_mesh(&m, &expected.meshes[0]);
        answer(client, version, "GET_STATUS", "Arthron", "STATUS");
        for (int at = next_of(client, "TRANSFORM", before); at >= 0;
             at = next_of(client, "TRANSFORM", at + 1))
            assert_string_equal(library_client_message(client, at).device, "virtual_tibia");
    }
    assert_int_equal(ended(&program, SIGTERM), 0);
    library_client_end(client);
}

static void a_session_that_is_repeated_goes_on_in_its_time(void **state) {
    (void)state;
    struct program program = start("100", "--loop");
    struct library_client *client = library_client_start(program.port);
    assert_non_null(client);
    int64_t last_ns = 0;
    const struct expected_set *end = &expected.sets[expected.set_count - 1];
    for (int at = 0; last_ns < end->stamp_ns + NS_PER_S; at++) {
        at = awaited(client, "TRANSFORM", at);
        struct library_message m = library_client_message(client, at);
        if (strcmp(m.device, "femur") != 0)
            continue;
        assert_true(m.stamp_ns >= last_ns);
        last_ns = m.stamp_ns;
    }
    assert_int_equal(ended(&program, SIGTERM), 0);
    library_client_end(client);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(all_that_was_recorded_arrives_beside_one_that_never_reads),
        cmocka_unit_test(what_is_asked_for_is_answered_in_the_version_of_the_question),
        cmocka_unit_test(a_session_that_is_repeated_goes_on_in_its_time),
    };
    return cmocka_run_group_tests(tests, make_served, remove_served);
}
