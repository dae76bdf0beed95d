#include "review/survey.h"
#include "trace/part_chain.h"
#include "trace/player.h"
#include "trace_commands.h"

#include <inttypes.h>
#include <jansson.h>
#include <stdio.h>
#include <string.h>

static const char verify_help[] =
    "Usage: arthron-trace verify FILE ... [--authority PEM] [--json]\n"
    "\n"
    "Reads every record. Reports whether the file is whole, which records were changed, and which\n"
    "server signed it. Compares each recorded touched surface with its hash. A session that still "
    "runs, or whose server was killed, has no end record "
    "and\n"
    "no signature. All records before that can be used.\n"
    "\n"
    "Several files must be the parts of one session, in any order: each whole or still open, and\n"
    "each later one begun with a state of the one before.\n"
    "\n"
    "  --authority PEM   the certificate of the trusted authority: authority.pem in a server's\n"
    "                    folder of keys. A missing or other signature is then a fault\n"
    "\n"
    "Exits 1 if records are damaged, cut off or missing, or the signature is wrong.\n";

#define DAMAGES_MAX 16

struct damage {
    uint64_t offset, bytes; // that are left out, 0: to the end
    uint64_t step;          // the last one before
    struct error why;
};

enum seal_state { SEAL_NONE, SEAL_GOOD, SEAL_BAD };

struct soundness {
    struct survey survey;
    struct damage damages[DAMAGES_MAX]; // the first
    int damage_count;
    uint64_t steps_behind; // that can be read behind the first damage
    enum seal_state seal;
    char signed_by[TRACE_SIGNED_BY_MAX];
    struct error seal_why;
};

static const char *const seal_names[] = {"none", "good", "bad"};

static bool count_behind(void *user, const struct trace_record *record) {
    struct soundness *v = user;
    (void)record;
    v->steps_behind++;
    return true;
}

// What can be read behind the damage that ended the survey.
static void read_behind(struct trace_reader *reader, struct soundness *v) {
    struct trace_player player = {.user = v, .step = count_behind};
    enum result result = v->survey.end;
    struct error why = v->survey.why;
    while (result == RESULT_CORRUPT || result == RESULT_FORMAT) {
        struct trace_place place = trace_reader_place(reader);
        struct damage damage = {.offset = place.offset, .step = place.step, .why = why};
        bool more = trace_skip_damage(reader, &damage.bytes, NULL) == RESULT_OK;
        if (v->damage_count < DAMAGES_MAX)
            v->damages[v->damage_count] = damage;
        v->damage_count++;
        if (!more)
            return;
        result = trace_play(reader, &player, &why);
    }
}

static void ask_seal(const struct trace_reader *reader, const char *authority,
                     struct soundness *v) {
    struct trace_seal seal;
    if (!trace_reader_seal(reader, &seal))
        return;
    enum result result =
        trace_seal_check(&seal, authority, v->survey.written_utc_ns, v->signed_by, &v->seal_why);
    v->seal = result == RESULT_OK ? SEAL_GOOD : SEAL_BAD;
}

static json_t *damages_array(const struct soundness *v) {
    json_t *array = json_array();
    for (int i = 0; i < v->damage_count && i < DAMAGES_MAX; i++)
        json_array_append_new(
            array, json_pack("{s:I, s:I, s:I, s:s}", "byte", (json_int_t)v->damages[i].offset,
                             "bytes", (json_int_t)v->damages[i].bytes, "after_step",
                             (json_int_t)v->damages[i].step, "why", v->damages[i].why.text));
    return array;
}

static json_t *soundness_object(const struct soundness *v) {
    const struct survey *s = &v->survey;
    json_t *root = json_pack(
        "{s:b, s:s, s:I, s:I, s:I, s:I, s:I}", "whole", s->end == RESULT_CLOSED, "end",
        s->end == RESULT_CLOSED ? "" : s->why.text, "whole_bytes", (json_int_t)s->whole_bytes,
        "file_bytes", (json_int_t)s->file_bytes, "records", (json_int_t)s->steps, "gaps",
        (json_int_t)s->gaps, "missing", (json_int_t)s->missing);
    json_t *more = json_pack(
        "{s:I, s:s, s:s, s:s, s:o, s:I}", "lost_samples", (json_int_t)s->lost_samples, "signature",
        seal_names[v->seal], "signed_by", v->signed_by, "signature_fault", v->seal_why.text,
        "damages", damages_array(v), "records_behind", (json_int_t)v->steps_behind);
    json_object_update_new(root, more);
    json_object_set_new(root, "disk_faults", json_integer((json_int_t)s->faults));
    json_object_set_new(root, "touches", json_integer((json_int_t)s->touches));
    return root;
}

static void print_verify_json(json_t *root) {
    json_dumpf(root, stdout, JSON_INDENT(2) | JSON_REAL_PRECISION(12));
    putchar('\n');
    json_decref(root);
}

static void print_seal(const struct soundness *v, bool asked) {
    if (v->seal == SEAL_NONE)
        printf("not signed%s\n",
               v->survey.end == RESULT_CLOSED ? "" : ": it was not closed, or its end is lost");
    else if (v->seal == SEAL_BAD)
        printf("signature wrong: %s\n", v->seal_why.text);
    else
        printf("signed by %s%s\n", v->signed_by, asked ? "" : " (--authority checks the signer)");
}

static void print_verify_text(const struct soundness *v, bool asked) {
    const struct survey *s = &v->survey;
    if (s->end == RESULT_CLOSED)
        printf("whole: %" PRIu64 " bytes\n", s->whole_bytes);
    else
        printf("not whole: %s\n%" PRIu64 " bytes of %" PRIu64 " are\n", s->why.text, s->whole_bytes,
               s->file_bytes);
    for (int i = 0; i < v->damage_count && i < DAMAGES_MAX; i++)
        printf("damaged after step %" PRIu64 ": %s\n", v->damages[i].step, v->damages[i].why.text);
    if (v->steps_behind)
        printf("%" PRIu64 " steps after that are unchanged\n", v->steps_behind);
    if (s->touches)
        printf("%" PRIu64 " changes of the touched surface have their hashes\n", s->touches);
    print_seal(v, asked);
    if (s->faults)
        printf("the disk failed %" PRIu64 " times; the bytes in doubt were written again\n",
               s->faults);
    printf("%" PRIu64 " steps, %" PRIu64 " missing in %" PRIu64 " gaps; in %" PRIu64
           " samples the station told that a device was silent\n",
           s->steps, s->missing, s->gaps, s->lost_samples);
}

static bool is_good(const struct soundness *v, bool asked) {
    bool believed = v->seal == SEAL_GOOD || (v->seal == SEAL_NONE && !asked);
    return v->survey.end == RESULT_CLOSED && v->survey.missing == 0 && believed;
}

static enum result look_at(const char *file, const char *authority, struct trace_header *header,
                           struct soundness *v, struct error *err) {
    struct trace_reader *reader;
    enum result result = trace_reader_create(file, &reader, err);
    if (result != RESULT_OK)
        return result;
    memset(v, 0, sizeof *v);
    *header = *trace_reader_header(reader);
    survey_read(reader, show_progress, &v->survey);
    read_behind(reader, v);
    ask_seal(reader, authority, v);
    trace_reader_destroy(&reader);
    return RESULT_OK;
}

static int verify(const char *file, const char *authority, bool json) {
    static struct soundness v;
    struct trace_header header;
    struct error err;
    if (look_at(file, authority, &header, &v, &err) != RESULT_OK)
        return failed("verify", &err);
    if (json)
        print_verify_json(soundness_object(&v));
    else
        print_verify_text(&v, authority);
    return is_good(&v, authority) ? EXIT_GOOD : EXIT_FAULT;
}

// ---- several parts ------------------------------------------------------------------------------

// A server that was killed leaves its part open, and the next one may still write its own.
static bool is_good_part(const struct soundness *v, bool asked) {
    return is_good(v, asked) || (v->survey.end == RESULT_MISSING && !v->survey.missing && !asked);
}

static json_t *part_object(const char *file, const struct trace_header *header,
                           const struct soundness *v) {
    json_t *object = soundness_object(v);
    json_object_set_new(object, "file", json_string(file));
    json_object_set_new(object, "part", json_integer(header->part));
    json_object_set_new(object, "server", json_string(header->server));
    json_object_set_new(object, "token", json_integer((json_int_t)header->token));
    return object;
}

// The signature of the last part is also of what the others have up to the states of later ones.
static bool needs_seal(const struct trace_header *header, int count, const char *authority) {
    return authority && header->part == count;
}

static int verify_parts(char **files, int count, const char *authority, bool json) {
    static struct soundness v;
    struct trace_header header;
    struct error err = {""};
    json_t *all = json_array();
    bool good = true;
    for (int i = 0; i < count; i++) {
        if (look_at(files[i], authority, &header, &v, &err) != RESULT_OK) {
            json_decref(all);
            return failed("verify", &err);
        }
        if (!json) {
            printf("%s%s, part %u:\n", i ? "\n" : "", files[i], header.part);
            print_verify_text(&v, authority);
        }
        json_array_append_new(all, part_object(files[i], &header, &v));
        good =
            good && v.seal != SEAL_BAD && is_good_part(&v, needs_seal(&header, count, authority));
    }
    enum result result = trace_parts_check((const char *const *)files, count, &err);
    if (json)
        print_verify_json(json_pack("{s:o, s:b, s:s}", "parts", all, "one_session",
                                    result == RESULT_OK, "why",
                                    result == RESULT_OK ? "" : err.text));
    else
        json_decref(all);
    if (!json && result == RESULT_OK)
        printf("\none session, parts 1 to %d\n", count);
    else if (!json)
        printf("\nnot one session: %s\n", err.text);
    return good && result == RESULT_OK ? EXIT_GOOD : EXIT_FAULT;
}

int command_verify(int argc, char **argv) {
    static const struct option options[] = {{"authority", required_argument, NULL, 'a'},
                                            {"json", no_argument, NULL, 'j'},
                                            {"help", no_argument, NULL, 'h'},
                                            {NULL, 0, NULL, 0}};
    bool json = false;
    const char *authority = NULL, *file;
    for (int c; (c = getopt_long(argc, argv, "", options, NULL)) != -1;) {
        if (c == 'h')
            return fputs(verify_help, stdout) < 0;
        if (c == 'j')
            json = true;
        else if (c == 'a')
            authority = optarg;
        else
            return usage_error(argv[0], "unknown option");
    }
    if (argc - optind > 1)
        return verify_parts(argv + optind, argc - optind, authority, json);
    if (take_file(argc, argv, &file) != EXIT_GOOD)
        return EXIT_USAGE;
    return verify(file, authority, json);
}
