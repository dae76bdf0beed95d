// Every number of a trace at the limits of its type, the hashes put right: whoever reads the trace
// answers. Where the numbers are, the reader itself tells: each of its calls is noted.
#include "base/bytes.h"
#include "base/check.h"
#include "folder.h"
#include "fuzz/boxes.h"
#include "fuzz/fuzz.h"
#include "records/session_row.h"
#include "test.h"
#include "trace/trace.h"
#include "unit/trace_mend.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

// The targets of that name.
int fuzz_trace(const uint8_t *data, size_t size);
int fuzz_export(const uint8_t *data, size_t size);

#define PLACES_MAX 65536
#define FIELDS_MAX 256 // of one record
#define KINDS 128      // the header, and each type of record with each kind of input

struct place {
    size_t at;
    int width;
    int kind, field;
    int fields; // of its record: two with as many of one kind are alike
};

static struct place places[PLACES_MAX];
static int place_count, field_count, kind;
static size_t base;
static bool noting;

static void note(const struct reader *r, int width) {
    if (!noting || r->underflow || place_count == PLACES_MAX)
        return;
    places[place_count++] =
        (struct place){base + r->used, width, kind, field_count % FIELDS_MAX, 0};
    field_count++;
}

uint8_t __real_read_u8(struct reader *r);
uint16_t __real_read_u16(struct reader *r);
uint32_t __real_read_u32(struct reader *r);
uint64_t __real_read_u64(struct reader *r);
int64_t __real_read_i64(struct reader *r);
void __real_read_text(struct reader *r, char *out_text, size_t out_size);
uint8_t __wrap_read_u8(struct reader *r);
uint16_t __wrap_read_u16(struct reader *r);
uint32_t __wrap_read_u32(struct reader *r);
uint64_t __wrap_read_u64(struct reader *r);
int64_t __wrap_read_i64(struct reader *r);
void __wrap_read_text(struct reader *r, char *out_text, size_t out_size);

uint8_t __wrap_read_u8(struct reader *r) {
    note(r, 1);
    return __real_read_u8(r);
}

uint16_t __wrap_read_u16(struct reader *r) {
    note(r, 2);
    return __real_read_u16(r);
}

uint32_t __wrap_read_u32(struct reader *r) {
    note(r, 4);
    return __real_read_u32(r);
}

uint64_t __wrap_read_u64(struct reader *r) {
    note(r, 8);
    return __real_read_u64(r);
}

int64_t __wrap_read_i64(struct reader *r) {
    note(r, 8);
    return __real_read_i64(r);
}

void __wrap_read_text(struct reader *r, char *out_text, size_t out_size) {
    note(r, 2); // its length
    __real_read_text(r, out_text, out_size);
}

// ---- where the numbers are ----------------------------------------------------------------------

#define RECORD_TYPE 4 // where it is in a record; the payload follows

static void end_record(void) {
    for (int i = 1; i <= field_count; i++)
        places[place_count - i].fields = field_count % FIELDS_MAX;
    field_count = 0;
}

static void begin_record(const uint8_t *record, size_t at) {
    int type = record ? record[RECORD_TYPE] : 0;
    bool has_input = type == TRACE_STEP || type == TRACE_PAST;
    kind = (8 * type + (has_input ? record[RECORD_TYPE + 1] % 8 : 0)) % KINDS;
    base = at;
    field_count = 0;
}

static void find_places(const uint8_t *data, size_t size) {
    static struct trace_record record;
    struct trace_reader *reader;
    place_count = 0;
    noting = true;
    begin_record(NULL, 0);
    enum result result = trace_reader_create(fuzz_file("a.trace", data, size), &reader, NULL);
    assert_int_equal(result, RESULT_OK);
    do {
        end_record();
        uint64_t at = trace_reader_offset(reader);
        if (at + RECORD_TYPE + 1 < size)
            begin_record(data + at, at);
    } while (trace_read(reader, &record, NULL) == RESULT_OK);
    end_record();
    noting = false;
    trace_reader_destroy(&reader);
}

// ---- who reads it -------------------------------------------------------------------------------

static const struct scene *find_boxes(void *user, uint64_t case_hash) {
    (void)user, (void)case_hash;
    return boxes();
}

static const struct scene *find_none(void *user, uint64_t case_hash) {
    (void)user, (void)case_hash;
    return NULL;
}

static void record_it(const char *path, scene_finder find) {
    struct session_score score;
    if (session_score_trace(path, "/nowhere.pem", find, NULL, &score, NULL) != RESULT_OK)
        return;
    assert_int_equal(score.count, 0); // nobody has signed it
    session_score_fini(&score);
}

// Files for others take ten times as long as the rest.
static void read_in_every_way(const uint8_t *data, size_t size, bool with_files) {
    int64_t last_ns;
    fuzz_trace(data, size);
    if (with_files)
        fuzz_export(data, size);
    const char *path = fuzz_file("a.trace", data, size);
    trace_is_open(path);
    trace_last_time(path, &last_ns, NULL);
    record_it(path, find_boxes);
    record_it(path, find_none);
}

// ---- the limits ---------------------------------------------------------------------------------

static void put(uint8_t *data, const struct place *place, uint64_t value) {
    for (int i = 0; i < place->width; i++)
        data[place->at + (size_t)i] = (uint8_t)(value >> 8 * i);
}

static void try_limits(const uint8_t *data, size_t size, const struct place *place) {
    uint64_t max = UINT64_MAX >> (64 - 8 * place->width), sign = max / 2 + 1;
    const uint64_t values[] = {0, 1, max - 1, max, sign};
    uint8_t *forged = alloc(size, 1);
    for (size_t i = 0; i < sizeof values / sizeof *values; i++) {
        memcpy(forged, data, size);
        put(forged, place, values[i]);
        trace_mend(forged, size);
        read_in_every_way(forged, size, values[i] == max);
    }
    free(forged);
}

static bool tried[KINDS][FIELDS_MAX][FIELDS_MAX];

// The fields that no trace before had.
static int try_all_limits(uint8_t *data, size_t size) {
    int fields = 0;
    trace_mend(data, size);
    find_places(data, size);
    for (int i = 0; i < place_count; i++) {
        bool *done = &tried[places[i].kind][places[i].fields][places[i].field];
        if (*done || places[i].at + (size_t)places[i].width > size)
            continue;
        *done = true;
        fields++;
        try_limits(data, size, &places[i]);
    }
    return fields;
}

// What those of the corpus lack, as the second record of a trace.
static const struct extra {
    const char *name;
    uint8_t type, size, payload[40];
} extras[] = {
    {"gap", TRACE_GAP, 8, {2}},
    {"past", TRACE_PAST, 9, {INPUT_EMPTY}},
    {"resume", TRACE_RESUME, 8, {1}},
    {"fault", TRACE_FAULT, 8, {1}},
    {"touch", TRACE_TOUCH, 21, {1, [9] = 4, [17] = 0, 2, 4, 6}},
    {"marker", TRACE_MARKER, 38, {1, [8] = 1, [24] = 1, 0, 'm', 1, 0, 'd'}},
    {"begun", TRACE_BEGUN, 30, {1, [6] = 1, 0, 't', [19] = 0xf0, 0x3f, [25] = 1, [29] = '['}},
    {"ended", TRACE_ENDED, 38, {1, [4] = 1, 1}},
};

static uint8_t *insert(const uint8_t *data, size_t *size, const struct extra *extra) {
    size_t record = RECORD_TYPE + 1 + (size_t)extra->size + TRACE_HASH_SIZE, at = 14 + 32;
    struct reader head = {data, *size, 10, false};
    at += __real_read_u32(&head);
    head.used = at;
    at += RECORD_TYPE + 1 + __real_read_u32(&head) + TRACE_HASH_SIZE;
    uint8_t *out = alloc(*size + record, 1);
    memcpy(out, data, at);
    out[at] = extra->size;
    out[at + RECORD_TYPE] = extra->type;
    memcpy(out + at + RECORD_TYPE + 1, extra->payload, extra->size);
    memcpy(out + at + record, data + at, *size - at);
    *size += record;
    return out;
}

static int try_extras(const char *name) {
    int fields = 0;
    for (size_t i = 0; i < sizeof extras / sizeof *extras; i++) {
        size_t size;
        char *plain = read_file(CORPUS, name, &size);
        uint8_t *data = insert((uint8_t *)plain, &size, &extras[i]);
        fields += try_all_limits(data, size);
        free(data);
        free(plain);
    }
    return fields;
}

static void each_number_at_the_limits_of_its_type_ends_no_reader(void **state) {
    (void)state;
    static const char *const names[] = {"cut", "steps", "version5-cut", "version4-cut",
                                        "version2-cut"};
    int count = 0;
    for (size_t i = 0; i < sizeof names / sizeof *names; i++) {
        size_t size;
        char *data = read_file(CORPUS, names[i], &size);
        count += try_all_limits((uint8_t *)data, size);
        free(data);
    }
    count += try_extras("steps");
    for (int type = 0; type <= TRACE_ENDED; type++) {
        bool of_type = false;
        for (int i = 8 * type; i < 8 * type + 8; i++)
            for (int fields = 0; fields < FIELDS_MAX; fields++)
                of_type = of_type || tried[i][fields][0];
        if (!of_type)
            fail_msg("no trace has a record of type %d", type);
    }
    printf("%d fields\n", count);
    assert_true(count > 200);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(each_number_at_the_limits_of_its_type_ends_no_reader),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
