// Brings the commands of pages to the sessions, so that the thread of the pages waits for nothing:
// those of one page one after the other, on a few threads, since an undo or a copy may take long.
#include "base/check.h"
#include "live/viewer.h"
#include "runtime/reply.h"

#include <stdio.h>
#include <stdlib.h>

struct page_command {
    struct live_server *live;
    struct ring *answers; // of the viewer's place, which another page may have by now
    uint32_t number;      // of the viewer
    char actor[64];
    const char *refusal; // or NULL
    bool of_trainee;
    arthron_Command command;
    arthron_Live item;
};

static void hide_names(struct page_command *c, arthron_CommandReply *reply) {
    struct blindness *blindness = &c->live->blindness;
    for (int i = 0; i < reply->sessions_count; i++) {
        arthron_SessionInfo *info = &reply->sessions[i];
        if (is_blind_to(blindness, c->actor, info->trainee))
            info->trainee[0] = '\0';
        if (is_blind_to(blindness, c->actor, info->next_trainee))
            info->next_trainee[0] = '\0';
    }
}

static struct parcel *answer(struct page_command *c) {
    c->item = (arthron_Live){.which_message = arthron_Live_command_reply_tag};
    arthron_CommandReply *reply = &c->item.message.command_reply;
    if (c->refusal)
        reply_refuse_as(reply, arthron_Why_Code_NOT_ALLOWED, NULL, "%s", c->refusal);
    else
        sessions_command(c->live->sessions, c->actor, &c->command, reply);
    if (c->of_trainee) // what is at the station may be another's
        reply->sessions_count = 0;
    hide_names(c, reply);
    struct parcel *parcel = parcel_of(&c->item, c->number);
    if (parcel)
        return parcel;
    reply->sessions_count = 0;
    reply->resections_count = 0;
    return parcel_of(&c->item, c->number);
}

// The ring has room for all that a page may have asked; it is full only where the page has gone.
static int64_t run_waiting_command(void *data) {
    struct page_command *c = data;
    struct parcel *parcel = answer(c);
    CHECK(parcel);
    if (!ring_push(c->answers, &parcel))
        free(parcel);
    live_news(c->live);
    return TASK_DONE;
}

static void finish(void *data, bool done) {
    (void)done;
    free(data);
}

bool command_runner_add(struct live_server *live, const struct viewer *viewer,
                        const arthron_Command *command, const char *refusal) {
    struct page_command *c = alloc(1, sizeof *c);
    c->live = live;
    c->answers = viewer->answers;
    c->number = viewer->number;
    c->refusal = refusal;
    c->command = *command;
    c->of_trainee = is_trainee(&viewer->account);
    if (c->of_trainee)
        snprintf(c->command.trainee, sizeof c->command.trainee, "%s", viewer->account.trainee);
    snprintf(c->actor, sizeof c->actor, "%s", viewer->account.name);
    struct pool_task task = {.key = (uint64_t)(viewer - live->viewers) + 1,
                             .run = run_waiting_command,
                             .finish = finish,
                             .data = c};
    bool added = task_pool_add(live->commands, &task);
    if (!added)
        free(c);
    return added;
}
