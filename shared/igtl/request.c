#include "igtl/request.h"

#include "base/clock.h"
#include "igtl/content.h"
#include "igtl/metadata.h"

#include <string.h>

static const int64_t patience_ns = 500 * NS_PER_MS;  // with a server that may send by itself
static const int64_t pause_ns = 2 * NS_PER_S;        // before it is asked again
static const int64_t get_pause_ns = 100 * NS_PER_MS; // before a GET_ is sent again, at least
static const int64_t slow_ns = NS_PER_S;             // of TDATA: it came, and no more
static const enum igtl_request_kind first_kind = IGTL_REQUEST_TDATA;
static const enum igtl_request_kind last_kind = IGTL_REQUEST_POSITION;

static const char *const names[] = {"auto", "TDATA", "QTDATA", "TRANSFORM", "POSITION", "none"};

const char *igtl_request_name(enum igtl_request_kind kind) {
    return names[kind];
}

static bool is_get(enum igtl_request_kind kind) {
    return kind == IGTL_REQUEST_TRANSFORM || kind == IGTL_REQUEST_POSITION;
}

static bool is_start(enum igtl_request_kind kind) {
    return kind == IGTL_REQUEST_TDATA || kind == IGTL_REQUEST_QTDATA;
}

static int64_t between(int64_t least, int64_t value, int64_t most) {
    return value < least ? least : value > most ? most : value;
}

// What a message of this type answers; NONE: no request of ours.
static enum igtl_request_kind kind_of(const char *type) {
    for (enum igtl_request_kind kind = first_kind; kind <= last_kind; kind++)
        if (!strcmp(type, names[kind]))
            return kind;
    return IGTL_REQUEST_NONE;
}

void igtl_request_begin(struct igtl_request *r, int64_t now_ns) {
    r->due_ns = r->kind == IGTL_REQUEST_AUTO ? now_ns + patience_ns : now_ns;
    r->count = 0;
    r->asked = IGTL_REQUEST_NONE;
    r->answered_ns = now_ns - pause_ns;
    r->greeted = r->unlimited = false;
    r->pace = 0;
    r->version = 1;
    for (int i = 0; i < IGTL_REQUEST_TOOLS_MAX; i++) {
        struct igtl_request_tool *tool = &r->tools[i];
        tool->asked_ns = tool->since_ns = tool->due_ns = tool->usual_ns = 0;
        tool->pause_ns = get_pause_ns;
        tool->unanswered = 0;
        tool->heard = false;
    }
}

void igtl_request_heard(struct igtl_request *r, int version) {
    if (version >= 1 && version <= IGTL_NEWEST_VERSION)
        r->version = version;
}

// ---- one tool -----------------------------------------------------------------------------------

// Without names, one request stands for all tools.
static int places(const struct igtl_request *r) {
    return r->tool_count ? r->tool_count : 1;
}

static int64_t shortest_ns(const struct igtl_request *r) {
    return r->tool_count ? r->interval_ms * NS_PER_MS : get_pause_ns;
}

static void note_asked(struct igtl_request_tool *tool, int64_t now_ns) {
    if (tool->heard)
        tool->unanswered = 0; // what was late has come, or never will
    else if (tool->unanswered)
        tool->pause_ns = between(tool->pause_ns, 2 * tool->pause_ns, patience_ns);
    if (!tool->unanswered++)
        tool->since_ns = now_ns;
    tool->heard = false;
    tool->asked_ns = now_ns;
    tool->due_ns = now_ns + tool->pause_ns;
}

// With several requests on their way, an answer that comes as soon as usual is the newest one's,
// and the others are lost. Else it is an older one's, and there are more to come.
static void note_answered(struct igtl_request_tool *tool, int64_t shortest_ns, int64_t now_ns) {
    int64_t passed_ns = now_ns - tool->asked_ns;
    tool->heard = true;
    if (tool->unanswered > 1 && (!tool->usual_ns || passed_ns > 4 * tool->usual_ns)) {
        tool->unanswered--;
        tool->due_ns = now_ns + between(get_pause_ns, 4 * (now_ns - tool->since_ns), pause_ns);
        return;
    }
    if (tool->unanswered == 1)
        tool->usual_ns = passed_ns > 0 ? passed_ns : 1;
    tool->unanswered = 0;
    tool->pause_ns = between(get_pause_ns, 4 * tool->usual_ns, pause_ns);
    tool->due_ns = between(now_ns, tool->asked_ns + shortest_ns, INT64_MAX);
}

static void answer_tools(struct igtl_request *r, const struct igtl_message *m, int64_t now_ns) {
    for (int i = 0; i < places(r); i++)
        for (int k = 0; k < m->count; k++)
            if (!r->tool_count || igtl_is_same_tool(r->tools[i].name, m->tools[k].name)) {
                note_answered(&r->tools[i], shortest_ns(r), now_ns);
                break;
            }
}

// ---- answers ------------------------------------------------------------------------------------

void igtl_request_answered(struct igtl_request *r, const struct igtl_message *m, int64_t now_ns) {
    enum igtl_request_kind kind = kind_of(m->type);
    if (r->kind == IGTL_REQUEST_AUTO && r->asked != IGTL_REQUEST_NONE && kind < r->asked)
        r->asked = kind; // late: another was asked for since
    if (is_start(kind) && r->pace < 2)
        r->pace = now_ns - r->answered_ns < slow_ns ? 2 : 1;
    if (is_get(kind) && kind == r->asked)
        answer_tools(r, m, now_ns);
    bool tries = kind == r->asked && r->pace == 1 && !r->unlimited;
    r->due_ns = now_ns + (tries ? slow_ns : pause_ns);
    r->answered_ns = now_ns;
    r->count = 0;
}

// ---- messages -----------------------------------------------------------------------------------

static size_t encode_answer(const struct igtl_request *r, const char *type, const char *device,
                            const uint8_t *content, size_t size, uint8_t *out) {
    struct igtl_head head = {.version = r->version, .type = type, .device = device};
    if (size)
        memcpy(out + igtl_message_content(head.version), content, size);
    return igtl_message_finish(&head, size, out);
}

// Of version 2, yet without a body: a server of version 1 may not skip that of a newer message.
static size_t encode_greeting(const struct igtl_request *r, uint8_t *out) {
    struct igtl_head head = {.version = 1, .type = "GET_STATUS", .device = r->device};
    size_t size = igtl_message_finish(&head, 0, out);
    out[1] = 2;
    return size;
}

// STT_TDATA and STT_QTDATA have the same body.
static size_t encode_start(const struct igtl_request *r, uint8_t *out) {
    uint8_t content[IGTL_START_SIZE];
    size_t size = igtl_write_start(r->unlimited ? 0 : r->interval_ms, r->coordinates, content);
    const char *type = r->asked == IGTL_REQUEST_TDATA ? "STT_TDATA" : "STT_QTDATA";
    return encode_answer(r, type, r->device, content, size, out);
}

static bool is_polling(const struct igtl_request *r, int64_t now_ns) {
    return is_get(r->asked) && now_ns - r->answered_ns < pause_ns;
}

// Of each tool, or while they are answered, of each whose turn it is.
static size_t encode_gets(struct igtl_request *r, int64_t now_ns, uint8_t *out) {
    const char *type = r->asked == IGTL_REQUEST_TRANSFORM ? "GET_TRANS" : "GET_POSITION";
    bool polling = is_polling(r, now_ns);
    size_t size = 0;
    for (int i = 0; i < places(r); i++) {
        if (polling && now_ns < r->tools[i].due_ns)
            continue;
        note_asked(&r->tools[i], now_ns);
        size += encode_answer(r, type, r->tool_count ? r->tools[i].name : "", NULL, 0, out + size);
    }
    return size;
}

// ---- whom to ask for what -----------------------------------------------------------------------

static void choose(struct igtl_request *r) {
    bool again = r->asked != IGTL_REQUEST_NONE;
    if (again && !r->count)
        return; // what was answered
    if (r->kind != IGTL_REQUEST_AUTO)
        r->asked = r->kind;
    else
        r->asked = !again || r->asked == last_kind ? first_kind : r->asked + 1;
}

// What was answered may be answered by one message, and no more: see `unlimited`.
static size_t ask(struct igtl_request *r, int64_t now_ns, uint8_t *out) {
    size_t size = 0;
    r->unlimited |= is_start(r->asked) && !r->count && r->pace == 1;
    choose(r);
    bool turns = r->kind == IGTL_REQUEST_AUTO && r->asked != last_kind;
    r->due_ns = now_ns + (turns ? patience_ns : pause_ns);
    if (r->kind == IGTL_REQUEST_AUTO && r->asked == first_kind)
        size = encode_answer(r, "GET_STATUS", r->device, NULL, 0, out);
    return size +
           (is_get(r->asked) ? encode_gets(r, now_ns, out + size) : encode_start(r, out + size));
}

size_t igtl_request_next(struct igtl_request *r, int64_t now_ns,
                         uint8_t out[IGTL_REQUEST_BYTES_MAX]) {
    if (igtl_request_due_ns(r, now_ns) > now_ns)
        return 0;
    size_t greeting = r->greeted ? 0 : encode_greeting(r, out), size = 0;
    r->greeted = true;
    if (is_polling(r, now_ns))
        size = encode_gets(r, now_ns, out + greeting);
    else if (now_ns >= r->due_ns)
        size = ask(r, now_ns, out + greeting);
    r->count += size > 0;
    return greeting + size;
}

int64_t igtl_request_due_ns(const struct igtl_request *r, int64_t now_ns) {
    int64_t due_ns = INT64_MAX;
    if (r->kind == IGTL_REQUEST_NONE)
        return due_ns;
    if (!r->greeted)
        return now_ns;
    if (!is_polling(r, now_ns))
        return r->due_ns;
    for (int i = 0; i < places(r); i++)
        if (r->tools[i].due_ns < due_ns)
            due_ns = r->tools[i].due_ns;
    return due_ns;
}
