#include "unit/live_page.h"

#include "base/clock.h"
#include "runtime/tissue_delta.h"
#include "test.h"

#include <pb_decode.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

const struct live_account instructor = {.name = "otto", .role = "instructor"};
const struct live_account technician = {.name = "tina", .role = "technician"};
const struct live_account trainee = {.name = "anna", .role = "trainee", .trainee = "anna"};

// ---- a page -------------------------------------------------------------------------------------

void open_page(struct page *page, struct live_server *live, const struct live_account *account) {
    *page = (struct page){.live = live, .viewer = live_server_join(live, account, "")};
    assert_non_null(page->viewer);
}

void close_page(struct page *page) {
    live_server_leave(page->live, page->viewer);
    tissue_fini(&page->tissue);
    free(page->payload);
}

void say(struct page *page, const arthron_Page *message) {
    live_server_take(page->live, page->viewer, message);
}

void watch(struct page *page, arthron_Watch_What what, const char *name, uint32_t rate_hz) {
    arthron_Page message = {.which_message = arthron_Page_watch_tag};
    arthron_Watch *w = &message.message.watch;
    w->what = what;
    w->rate_hz = rate_hz;
    w->meshes = page->meshes = true;
    snprintf(what == arthron_Watch_What_RECORDED ? w->session : w->station, 33, "%s", name);
    say(page, &message);
}

void ask_for_meshes(struct page *page) {
    arthron_Page message = {.which_message = arthron_Page_mesh_ask_tag};
    say(page, &message);
}

static void acknowledge(struct page *page, const char *group) {
    arthron_Page message = {.which_message = arthron_Page_mesh_ack_tag};
    arthron_MeshState *ack = &message.message.mesh_ack;
    snprintf(ack->group, sizeof ack->group, "%s", group);
    ack->number = page->tissue.number;
    ack->hash = page->tissue.hash;
    say(page, &message);
}

static void take_chunk(struct page *page, pb_istream_t *stream) {
    static arthron_MeshChunk chunk;
    struct error err = {""};
    pb_istream_t inner;
    assert_true(pb_make_string_substream(stream, &inner));
    assert_true(pb_decode(&inner, arthron_MeshChunk_fields, &chunk));
    pb_close_string_substream(stream, &inner);
    if (chunk.index == 0)
        page->payload_size = 0;
    assert_int_equal(page->payload_size, chunk.index * WIRE_CHUNK_DATA);
    page->payload = realloc(page->payload, chunk.size);
    memcpy(page->payload + page->payload_size, chunk.data.bytes, chunk.data.size);
    page->payload_size += chunk.data.size;
    if (page->payload_size < chunk.size)
        return;
    assert_int_equal(tissue_payload_hash(page->payload, chunk.size), chunk.hash);
    if (chunk.base == 0)
        tissue_fini(&page->tissue);
    if (tissue_apply(&page->tissue, page->payload, chunk.size, &err) != RESULT_OK)
        fail_msg("%s", err.text);
    assert_int_equal(page->tissue.number, chunk.number);
    page->payloads++;
    if (!page->session.recorded)
        acknowledge(page, chunk.group);
}

static void take_moment(struct page *page, const arthron_Moment *moment) {
    page->moments++;
    page->fell |= moment->step <= page->last_step || moment->time_ns < page->last_ns;
    page->last_step = moment->step;
    page->last_ns = moment->time_ns;
}

static void take_session(struct page *page, const arthron_LiveSession *session) {
    static const uint8_t none[16];
    page->sessions++;
    page->session = *session;
    page->last_step = 0;
    page->last_ns = 0;
    if (page->meshes && !session->recorded && memcmp(session->id, none, sizeof none))
        ask_for_meshes(page);
}

static double value_of(const arthron_Metrics *metrics, const char *name) {
    for (int i = 0; i < metrics->metrics_count; i++)
        if (!strcmp(metrics->metrics[i].name, name))
            return metrics->metrics[i].value;
    fail_msg("there is no %s", name);
    return 0;
}

static void take_item(struct page *page, const arthron_Live *item) {
    switch (item->which_message) {
    case arthron_Live_place_tag:
        page->places++;
        page->place = item->message.place;
        break;
    case arthron_Live_session_tag:
        take_session(page, &item->message.session);
        break;
    case arthron_Live_moment_tag:
        take_moment(page, &item->message.moment);
        break;
    case arthron_Live_resection_tag:
        page->resections++;
        page->resection = item->message.resection;
        break;
    case arthron_Live_remark_tag:
        page->remarks++;
        page->remark = item->message.remark;
        break;
    case arthron_Live_marker_tag:
        page->markers++;
        page->marker = item->message.marker;
        break;
    case arthron_Live_metrics_tag:
        page->metrics++;
        page->time_s = value_of(&item->message.metrics, "time");
        break;
    case arthron_Live_command_reply_tag:
        page->replies++;
        page->reply = item->message.command_reply;
        break;
    case arthron_Live_progress_tag:
        page->progresses++;
        page->done |= item->message.progress.done;
        break;
    case arthron_Live_beat_tag:
        page->beats++;
        break;
    default:
        assert_int_equal(item->which_message, arthron_Live_trouble_tag);
        page->troubles++;
        page->trouble_kind = item->message.trouble.kind;
        snprintf(page->trouble, sizeof page->trouble, "%s", item->message.trouble.text);
        break;
    }
}

static void read_batch(struct page *page, const uint8_t *bytes, size_t size) {
    static arthron_Live item;
    pb_istream_t stream = pb_istream_from_buffer(bytes, size);
    page->batches++;
    while (stream.bytes_left) {
        pb_istream_t inner, peek;
        pb_wire_type_t type;
        uint32_t tag;
        bool end;
        assert_true(pb_decode_tag(&stream, &type, &tag, &end));
        assert_int_equal(tag, 1);
        assert_true(pb_make_string_substream(&stream, &inner));
        peek = inner;
        assert_true(pb_decode_tag(&peek, &type, &tag, &end));
        if (tag == 5) {
            take_chunk(page, &peek);
            pb_read(&inner, NULL, inner.bytes_left);
        } else {
            assert_true(pb_decode(&inner, arthron_Live_fields, &item));
            take_item(page, &item);
        }
        assert_true(pb_close_string_substream(&stream, &inner));
    }
}

int64_t draw_at(struct page *page, int64_t now_ns) {
    static uint8_t bytes[LIVE_BATCH_MAX];
    int64_t next_ns = now_ns;
    size_t size =
        live_server_batch(page->live, page->viewer, now_ns, bytes, sizeof bytes, &next_ns);
    assert_true(size <= sizeof bytes);
    assert_true(size || next_ns > now_ns); // else nobody asks again
    read_batch(page, bytes, size);
    if (size == 0)
        page->batches--;
    return next_ns;
}

int64_t draw(struct page *page) {
    return draw_at(page, clock_now_ns());
}

void draw_for(struct page *page, long ms) {
    int64_t end_ns = clock_now_ns() + ms * NS_PER_MS;
    while (clock_now_ns() < end_ns)
        if (draw(page) > clock_now_ns())
            hall_wait_ms(1);
}

void draw_until(struct page *page, const int *count, int least) {
    for (int i = 0; i < 10000 && *count < least; i++)
        if (draw(page) > clock_now_ns())
            hall_wait_ms(1);
    assert_true(*count >= least);
}

void draw_until_shown(struct page *page, const struct tissue_report *report) {
    const struct tissue_figures *figures = &report->figures[0];
    for (int i = 0; i < 10000 && (page->tissue.number < figures->mesh_number ||
                                  page->resection.cuts < figures->cuts);
         i++)
        if (draw(page) > clock_now_ns())
            hall_wait_ms(1);
}

// ---- a live server ------------------------------------------------------------------------------

static bool allow(void *user, const struct live_account *account, const char *session) {
    (void)user, (void)session;
    return !strcmp(account->role, "instructor");
}

struct live_server *open_live(struct sessions *sessions) {
    struct live_config config = {.allowed = allow};
    return live_server_create(sessions, &config);
}

void command(struct page *page, arthron_Command_Kind kind, const char *text) {
    arthron_Page message = {.which_message = arthron_Page_command_tag};
    message.message.command = (arthron_Command){.kind = kind, .station = "room-1"};
    message.message.command.has_remark = true;
    snprintf(message.message.command.remark.text, REMARK_TEXT_MAX, "%s", text);
    say(page, &message);
}

void copy(struct page *page, const char *from) {
    arthron_Page message = {.which_message = arthron_Page_command_tag};
    message.message.command =
        (arthron_Command){.kind = arthron_Command_Kind_COPY, .station = "room-1"};
    snprintf(message.message.command.from, sizeof message.message.command.from, "%s", from);
    say(page, &message);
}
