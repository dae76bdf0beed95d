#include "hub/remarks.h"

#include "base/check.h"
#include "hub/reply.h"
#include "hub/seat.h"
#include "store/text.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

// ---- what was said ------------------------------------------------------------------------------

void remarks_fini(struct remarks *r) {
    free(r->all);
    *r = (struct remarks){0};
}

void remarks_put(struct remarks *r, const struct remark *remark) {
    CHECK(remark_is_valid(remark));
    if (!r->all)
        r->all = alloc(REMARKS_MAX, sizeof *r->all);
    r->revision++;
    for (; r->count < (int)remark->number; r->count++)
        r->all[r->count] = (struct kept_remark){
            r->revision,
            {.number = (uint32_t)r->count + 1, .time_ns = remark->time_ns, .withdrawn = true}};
    r->all[remark->number - 1] = (struct kept_remark){r->revision, *remark};
}

void remarks_begin(struct remarks *r, uint64_t session, struct remarks *said) {
    struct remarks none = {0}, *from = said ? said : &none;
    uint64_t revision = r->revision + from->revision + 1;
    free(r->all);
    *r = (struct remarks){session, revision, from->count, from->all};
    for (int i = 0; i < r->count; i++)
        r->all[i].revision = revision;
    *from = none;
}

void remark_to_wire(const struct remark *r, int64_t start_ns, arthron_Remark *out) {
    *out = (arthron_Remark){
        .number = r->number,
        .time_ns = r->time_ns - start_ns,
        .has_marker = r->has_marker,
        .body = (arthron_Body)r->body,
        .has_point = true,
        .point = {r->point.x, r->point.y, r->point.z},
        .withdrawn = r->withdrawn,
    };
    snprintf(out->author, sizeof out->author, "%s", r->author);
    snprintf(out->text, sizeof out->text, "%s", r->text);
}

// ---- the command --------------------------------------------------------------------------------

_Static_assert(sizeof((arthron_Remark *)0)->text == REMARK_TEXT_MAX &&
                   sizeof((arthron_Remark *)0)->author == REMARK_AUTHOR_MAX,
               "a remark of the wire is one of the trace");

// Its number and time are still to come.
static struct remark remark_of(const arthron_Remark *message, const char *author) {
    struct remark remark = {
        .number = 1,
        .withdrawn = message->withdrawn,
        .has_marker = message->has_marker,
        .body = (enum body)message->body,
        .point = {message->point.x, message->point.y, message->point.z},
    };
    snprintf(remark.author, sizeof remark.author, "%s", author);
    memcpy(remark.text, message->text, sizeof remark.text);
    return remark;
}

// card_lock held. Who withdraws a remark or changes it says so by its number; it keeps its time.
static bool number_it(struct seat *seat, uint64_t wanted, struct remark *remark,
                      arthron_CommandReply *reply) {
    const struct remarks *r = &seat->remarks;
    if (wanted > (uint64_t)r->count)
        return reply_refuse(reply, "station %s: there is no remark %llu", seat->station->name,
                            (unsigned long long)wanted);
    if (!wanted && r->count == REMARKS_MAX)
        return reply_refuse(reply, "station %s: a session has at most %d remarks",
                            seat->station->name, REMARKS_MAX);
    newest_take(seat->moment_news, &seat->moment);
    bool has_moment = seat->moment.session == r->session;
    remark->number = wanted ? (uint32_t)wanted : (uint32_t)r->count + 1;
    remark->time_ns = has_moment ? seat->moment.time_ns : seat->card.about.start_ns;
    if (wanted)
        remark->time_ns = r->all[wanted - 1].remark.time_ns;
    return true;
}

bool remarks_command(struct hub *hub, int index, const char *author, const arthron_Remark *message,
                     arthron_CommandReply *reply) {
    struct seat *seat = &hub->seats[index];
    struct note note = {.kind = NOTE_REMARK, .seat = index};
    note.remark = remark_of(message, author);
    const char *text = note.remark.text; // none where there is a marker alone
    bool is_shown = !text[0] || text_check(text, "remark", REMARK_TEXT_MAX, NULL) == RESULT_OK;
    if (!is_shown || !remark_is_valid(&note.remark))
        return reply_refuse(reply, "a remark has a text of one line, or a marker near a bone");
    pthread_mutex_lock(&hub->card_lock);
    note.session = seat->remarks.session;
    bool good = number_it(seat, message->number, &note.remark, reply);
    pthread_mutex_unlock(&hub->card_lock);
    struct worker *worker = seat_worker(hub, index);
    if (good && !worker_tell(worker, worker->from_desk, &note))
        return reply_refuse(reply, "station %s: its worker is too busy", seat->station->name);
    if (!good)
        return false;
    pthread_mutex_lock(&hub->card_lock);
    remarks_put(&seat->remarks, &note.remark);
    pthread_mutex_unlock(&hub->card_lock);
    return true;
}
