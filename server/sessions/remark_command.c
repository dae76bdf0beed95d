#include "sessions/remark_command.h"

#include "base/clock.h"
#include "runtime/reply.h"
#include "store/text.h"

#include <stdio.h>
#include <string.h>

#define TAKEN_WAIT_NS (5 * NS_PER_S)

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

// A remark is withdrawn or changed by its number; it keeps its time.
static bool number_it(struct sessions *s, int station, uint64_t wanted, struct remark *remark,
                      uint64_t *out_session, arthron_CommandReply *reply) {
    struct station_slot *slot = &s->slots[station];
    struct step_snapshot now;
    runtime_snapshot(s->runtime, station, &now);
    pthread_mutex_lock(&slot->lock);
    const struct remarks *r = &slot->remarks;
    int count = r->count;
    *out_session = r->session;
    remark->number = wanted ? (uint32_t)wanted : (uint32_t)count + 1;
    remark->time_ns = now.session == r->session ? now.time_ns : slot->status.about.start_ns;
    if (wanted && wanted <= (uint64_t)count)
        remark->time_ns = r->all[wanted - 1].remark.time_ns;
    pthread_mutex_unlock(&slot->lock);
    char number[24];
    snprintf(number, sizeof number, "%llu",
             wanted ? (unsigned long long)wanted : (unsigned long long)REMARKS_MAX);
    if (wanted > (uint64_t)count)
        return reply_refuse_as(reply, arthron_Why_Code_NO_REMARK, number,
                               "station %s: there is no remark %llu", station_name(s, station),
                               (unsigned long long)wanted);
    if (!wanted && count == REMARKS_MAX)
        return reply_refuse_as(reply, arthron_Why_Code_REMARKS_FULL, number,
                               "station %s: a session has at most %d remarks",
                               station_name(s, station), REMARKS_MAX);
    return true;
}

static bool put_into_trace(struct sessions *s, int station, uint64_t session,
                           const struct remark *remark, arthron_CommandReply *reply) {
    struct station_slot *slot = &s->slots[station];
    uint64_t ticket = station_slot_new_ticket(slot);
    bool done;
    if (!runtime_remark(s->runtime, station, session, remark, ticket) ||
        !station_slot_wait_taken(slot, ticket, clock_now_ns() + TAKEN_WAIT_NS, &done))
        return reply_refuse_as(reply, arthron_Why_Code_BUSY, station_name(s, station),
                               "station %s: its worker is too busy", station_name(s, station));
    if (!done)
        return reply_refuse_as(reply, arthron_Why_Code_NOT_RECORDED, NULL,
                               "station %s: its trace did not take the remark",
                               station_name(s, station));
    return true;
}

bool remark_command(struct sessions *s, int station, const char *author,
                    const arthron_Remark *message, arthron_CommandReply *reply) {
    struct station_slot *slot = &s->slots[station];
    struct remark remark = remark_of(message, author);
    uint64_t session;
    const char *text = remark.text; // none where there is a marker alone
    bool is_shown = !text[0] || text_check(text, "remark", REMARK_TEXT_MAX, NULL) == RESULT_OK;
    if (!is_shown || !remark_is_valid(&remark))
        return reply_refuse_as(reply, arthron_Why_Code_WRONG_REMARK, NULL,
                               "a remark has a text of one line, or a marker near a bone");
    if (!number_it(s, station, message->number, &remark, &session, reply) ||
        !put_into_trace(s, station, session, &remark, reply))
        return false;
    pthread_mutex_lock(&slot->lock);
    if (slot->remarks.session == session)
        remarks_put(&slot->remarks, &remark);
    pthread_mutex_unlock(&slot->lock);
    return reply->ok = true;
}
