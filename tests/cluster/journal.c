// The journal of a session as messages: whatever is lost, late or of another server, what the
// reader gives is what the writer had up to a message, and no more.
#include "base/chance.h"
#include "base/check.h"
#include "cluster/posting.h"
#include "test.h"
#include "unit/trace_files.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#define MESSAGES_MAX 512
#define REMARKS_TOLD 60

static struct error err;
static uint8_t *state_bytes;
static size_t state_size;

// ---- a stream -----------------------------------------------------------------------------------

struct stream {
    int count;
    struct jet_message of[MESSAGES_MAX];
};

static void keep(struct stream *stream, const struct jet_message *message) {
    CHECK(stream->count < MESSAGES_MAX);
    struct jet_message *kept = &stream->of[stream->count++];
    *kept = *message;
    uint8_t *data = alloc(message->size + 1, 1);
    if (message->size)
        memcpy(data, message->data, message->size);
    kept->data = data;
}

static void drain(struct journal_writer *writer, struct stream *stream) {
    struct jet_message message;
    while (journal_next(writer, &message))
        keep(stream, &message);
}

static void release(struct stream *stream) {
    for (int i = 0; i < stream->count; i++)
        free((void *)stream->of[i].data);
    stream->count = 0;
}

// ---- what is written ----------------------------------------------------------------------------

static struct trace_record remark(uint32_t number) {
    struct trace_record record = {.type = TRACE_REMARK, .offset = 1000 + number};
    record.remark = (struct remark){.number = number, .time_ns = number};
    snprintf(record.remark.author, sizeof record.remark.author, "ada");
    snprintf(record.remark.text, sizeof record.remark.text, "remark %u", number);
    return record;
}

static struct trace_record command(uint64_t number) {
    struct trace_record record = {.type = TRACE_STEP, .offset = 1000 + number};
    record.input = (struct session_input){.kind = INPUT_PAUSE, .time_ns = (int64_t)number};
    return record;
}

static void begin(struct journal_writer *writer) {
    static const struct job none;
    struct trace_header header = some_header();
    journal_begin(writer, &header, path, &none);
}

static void put_base(struct journal_writer *writer) {
    journal_kept(writer);
    assert_string_equal(journal_wants_state(writer, 1), path);
    assert_true(journal_put_state(writer, state_bytes, state_size, 1));
}

static void tell_remark(struct journal_writer *writer, uint32_t number) {
    struct trace_record record = remark(number);
    journal_record(writer, &record);
}

// ---- what is read -------------------------------------------------------------------------------

static enum result read_all(const struct stream *stream, int but, struct journal_session *session,
                            int *out_remarks, int *out_commands) {
    struct journal_reader *reader = journal_reader_create();
    struct trace_record record;
    *out_remarks = *out_commands = 0;
    for (int i = 0; i < stream->count; i++)
        if (i != but)
            journal_take(reader, &stream->of[i]);
    enum result result = journal_read(reader, session, &err);
    while (result == RESULT_OK && journal_next_record(reader, &record, &err) == RESULT_OK) {
        if (record.type == TRACE_REMARK)
            assert_int_equal(record.remark.number, ++*out_remarks);
        *out_commands += record.type == TRACE_PAST;
    }
    if (result == RESULT_OK) {
        assert_int_equal(session->state_size, state_size);
        assert_memory_equal(session->state, state_bytes, state_size);
    }
    session->state = NULL; // the reader's
    journal_reader_destroy(&reader);
    return result;
}

static struct stream stream;
static struct journal_session session;
static int remarks, commands;

static struct journal_writer *owner(uint64_t token) {
    struct journal_writer *writer = journal_writer_create();
    journal_own(writer, token);
    journal_go_on(writer, token);
    begin(writer);
    return writer;
}

static void what_is_told_is_read(void **state) {
    (void)state;
    struct journal_writer *writer = owner(7);
    tell_remark(writer, 1);
    drain(writer, &stream);
    assert_int_equal(stream.count, 1); // `owned`: without a state there is no base
    put_base(writer);
    tell_remark(writer, 2);
    struct trace_record pause = command(5);
    journal_record(writer, &pause);
    drain(writer, &stream);
    assert_true(journal_is_whole(writer));
    assert_ok(read_all(&stream, -1, &session, &remarks, &commands));
    assert_int_equal(remarks, 2);
    assert_int_equal(commands, 1);
    assert_int_equal(session.token, 7);
    assert_false(session.has_ended);
    struct trace_header header = some_header();
    assert_memory_equal(session.header.session_id, header.session_id, sizeof header.session_id);
    journal_end(writer);
    drain(writer, &stream);
    assert_ok(read_all(&stream, -1, &session, &remarks, &commands));
    assert_true(session.has_ended);
    journal_writer_destroy(&writer);
    release(&stream);
}

// Each message lost in turn: what is read is a beginning of what was told, up to the gap.
static void behind_a_lost_message_nothing_counts(void **state) {
    (void)state;
    struct journal_writer *writer = owner(7);
    put_base(writer);
    for (uint32_t i = 1; i <= REMARKS_TOLD; i++) {
        tell_remark(writer, i);
        drain(writer, &stream);
    }
    int first = stream.count - REMARKS_TOLD; // behind `owned` and the base
    for (int but = 1; but < stream.count; but++) {
        enum result result = read_all(&stream, but, &session, &remarks, &commands);
        assert_int_equal(result, but < first ? RESULT_MISSING : RESULT_OK);
        assert_int_equal(remarks, but < first ? 0 : but - first);
    }
    journal_writer_destroy(&writer);
    release(&stream);
}

static void a_new_base_mends_what_was_lost(void **state) {
    (void)state;
    struct journal_writer *writer = owner(7);
    put_base(writer);
    tell_remark(writer, 1);
    drain(writer, &stream);
    int lost = stream.count;
    tell_remark(writer, 2);
    drain(writer, &stream);
    journal_break(writer);
    assert_false(journal_is_whole(writer));
    assert_false(journal_owns(writer)); // which may be what was lost
    tell_remark(writer, 3);
    assert_true(journal_put_state(writer, state_bytes, state_size, 2));
    drain(writer, &stream);
    assert_ok(read_all(&stream, lost, &session, &remarks, &commands));
    assert_int_equal(remarks, 3);
    journal_writer_destroy(&writer);
    release(&stream);
}

// A server that was paused goes on writing behind the next one's first word.
static void what_an_older_owner_writes_behind_a_newer_one_is_void(void **state) {
    (void)state;
    struct journal_writer *old = owner(7), *new = journal_writer_create();
    put_base(old);
    tell_remark(old, 1);
    drain(old, &stream);
    journal_own(new, 9);
    drain(new, &stream);
    tell_remark(old, 2);
    journal_end(old);
    drain(old, &stream);
    assert_ok(read_all(&stream, -1, &session, &remarks, &commands));
    assert_int_equal(remarks, 1);
    assert_int_equal(session.token, 7);
    assert_int_equal(session.newest_token, 9);
    assert_false(session.has_ended);
    journal_writer_destroy(&old);
    journal_writer_destroy(&new);
    release(&stream);
}

// It may have had a session before another one had the station.
static void an_owner_writes_its_first_word_alone_until_it_knows_what_others_wrote(void **state) {
    (void)state;
    struct journal_writer *writer = owner(7);
    put_base(writer);
    drain(writer, &stream);
    int before = stream.count;
    journal_own(writer, 9);
    tell_remark(writer, 1);
    assert_null(journal_wants_state(writer, 1));
    journal_go_on(writer, 7); // of an earlier read
    drain(writer, &stream);
    assert_int_equal(stream.count, before + 1);
    assert_string_equal(stream.of[before].kind, "owned");
    assert_true(journal_owns(writer));
    assert_false(journal_is_whole(writer));
    journal_go_on(writer, 9);
    assert_string_equal(journal_wants_state(writer, 1), path);
    assert_true(journal_put_state(writer, state_bytes, state_size, 1));
    drain(writer, &stream);
    assert_ok(read_all(&stream, -1, &session, &remarks, &commands));
    assert_int_equal(remarks, 1);
    assert_int_equal(session.token, 9);
    journal_writer_destroy(&writer);
    release(&stream);
}

static void an_end_that_was_perhaps_lost_is_told_again(void **state) {
    (void)state;
    struct journal_writer *writer = owner(7);
    put_base(writer);
    drain(writer, &stream);
    int lost = stream.count;
    journal_end(writer);
    drain(writer, &stream);
    journal_break(writer);
    drain(writer, &stream);
    assert_ok(read_all(&stream, lost, &session, &remarks, &commands));
    assert_true(session.has_ended);
    int ends = stream.count;
    begin(writer);
    journal_break(writer);
    drain(writer, &stream);
    assert_int_equal(stream.count, ends + 1); // `owned`, and no end of the next session
    journal_writer_destroy(&writer);
    release(&stream);
}

static void a_session_that_moves_has_a_base_of_its_next_state(void **state) {
    (void)state;
    struct journal_writer *writer = owner(7);
    put_base(writer);
    drain(writer, &stream);
    journal_refresh(writer);
    assert_true(journal_is_fresh(writer)); // nothing came behind its base
    struct trace_record cut = {.type = TRACE_TAKEN, .offset = 2000};
    cut.output.job = (struct job){.id = 1, .kind = JOB_UNDO};
    journal_record(writer, &cut);
    journal_kept(writer);
    journal_refresh(writer);
    assert_false(journal_is_fresh(writer));
    assert_null(journal_wants_state(writer, 2)); // what was kept is older than the wish
    journal_kept(writer);
    assert_string_equal(journal_wants_state(writer, 2), path);
    assert_true(journal_put_state(writer, state_bytes, state_size, 2));
    assert_true(journal_is_fresh(writer));
    drain(writer, &stream);
    assert_ok(read_all(&stream, -1, &session, &remarks, &commands));
    journal_writer_destroy(&writer);
    release(&stream);
}

// Gives out its first word and a base, which are stored from the sequence on.
static void post_base(struct posting *posting, struct journal_writer *writer, uint64_t sequence) {
    struct jet_message message;
    bool begins;
    journal_break(writer);
    put_base(writer);
    while (posting_next(posting, writer, &message, &begins))
        posting_answered(posting, message.token, begins, WRITE_DONE, sequence++);
}

static void what_another_owner_may_have_written_is_not_purged(void **state) {
    (void)state;
    struct posting posting = {0};
    struct journal_writer *writer = owner(7);
    posting_own(&posting, 7);
    post_base(&posting, writer, 20);
    assert_int_equal(posting_purges(&posting, false), 0);
    assert_int_equal(posting_purges(&posting, true), 21);
    assert_int_equal(posting_purges(&posting, true), 0);
    post_base(&posting, writer, 30);
    posting_own(&posting, 0);
    assert_int_equal(posting_purges(&posting, true), 0);
    posting_own(&posting, 9); // the base is of 7
    assert_int_equal(posting_purges(&posting, true), 0);
    journal_own(writer, 9);
    journal_go_on(writer, 9);
    post_base(&posting, writer, 40);
    atomic_fetch_add(&posting.in_flight, 1);
    posting_answered(&posting, 7, true, WRITE_DONE, 50); // late
    assert_int_equal(posting_purges(&posting, true), 41);
    journal_writer_destroy(&writer);
}

// Commands before the state's place are in the state, remarks are not.
static void what_a_state_has_is_not_told_again(void **state) {
    (void)state;
    struct trace_state parsed;
    struct journal_writer *writer = owner(7);
    assert_ok(trace_state_parse(state_bytes, state_size, &parsed, &err));
    struct trace_record before = command(1), behind = command(2);
    before.offset = parsed.place.offset - 1;
    behind.offset = parsed.place.offset;
    journal_record(writer, &before);
    tell_remark(writer, 1);
    journal_record(writer, &behind);
    put_base(writer);
    drain(writer, &stream);
    assert_ok(read_all(&stream, -1, &session, &remarks, &commands));
    assert_int_equal(commands, 1);
    assert_int_equal(remarks, 1);
    journal_writer_destroy(&writer);
    release(&stream);
}

// A base may be larger than a message.
static void bytes_that_are_damaged_are_refused(void **state) {
    (void)state;
    struct journal_writer *writer = owner(7);
    put_base(writer);
    drain(writer, &stream);
    uint8_t *base = (uint8_t *)stream.of[1].data;
    size_t size = stream.of[1].size;
    for (int i = 0; i < 2000; i++) {
        uint32_t where, what;
        chance_fill(&where, sizeof where);
        chance_fill(&what, sizeof what);
        size_t at = where % size;
        uint8_t kept = base[at];
        base[at] = (uint8_t)what;
        struct journal_reader *reader = journal_reader_create();
        struct trace_record record;
        for (int k = 0; k < stream.count; k++)
            journal_take(reader, &stream.of[k]);
        if (journal_read(reader, &session, &err) == RESULT_OK)
            while (journal_next_record(reader, &record, &err) == RESULT_OK)
                ;
        journal_reader_destroy(&reader);
        base[at] = kept;
    }
    journal_writer_destroy(&writer);
    release(&stream);
}

// ---- a state ------------------------------------------------------------------------------------

#define STATE_BYTES ((size_t)1 << 20)

static int make_state(void **state) {
    make_folder(state);
    struct trace_writer *writer = start_writing();
    struct session_input input;
    struct session_output output;
    step_at(1, &input, &output);
    assert_true(trace_append(writer, &input, &output));
    struct trace_state kept = {.output_hash = output.hash, .size = STATE_BYTES};
    trace_place_behind(writer, trace_position(writer), &output, &kept.place);
    kept.content = alloc(STATE_BYTES, 1);
    chance_fill(kept.content, STATE_BYTES);
    enum result result;
    while ((result = trace_state_write(path, &kept, &err)) == RESULT_MISSING)
        usleep(10000);
    assert_ok(result);
    free(kept.content);
    assert_ok(trace_state_load(path, &state_bytes, &state_size, &err));
    trace_writer_destroy(&writer);
    return 0;
}

static int remove_state(void **state) {
    free(state_bytes);
    trace_state_remove(path);
    return remove_folder(state);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(what_is_told_is_read),
        cmocka_unit_test(behind_a_lost_message_nothing_counts),
        cmocka_unit_test(a_new_base_mends_what_was_lost),
        cmocka_unit_test(what_an_older_owner_writes_behind_a_newer_one_is_void),
        cmocka_unit_test(an_owner_writes_its_first_word_alone_until_it_knows_what_others_wrote),
        cmocka_unit_test(an_end_that_was_perhaps_lost_is_told_again),
        cmocka_unit_test(a_session_that_moves_has_a_base_of_its_next_state),
        cmocka_unit_test(what_another_owner_may_have_written_is_not_purged),
        cmocka_unit_test(what_a_state_has_is_not_told_again),
        cmocka_unit_test(bytes_that_are_damaged_are_refused),
    };
    return cmocka_run_group_tests(tests, make_state, remove_state);
}
