#include "hub/onlookers.h"

#include <string.h>

static void free_place(struct onlooker *onlooker) {
    tray_release(&onlooker->tray);
    memset(onlooker->cursors, 0, sizeof onlooker->cursors);
}

static void let_go(struct onlookers *o) {
    for (int i = 0; i < ONLOOKERS_MAX; i++)
        if (o->all[i].tray && tray_is_left(o->all[i].tray))
            free_place(&o->all[i]);
}

void onlookers_forget(struct onlookers *o) {
    let_go(o);
    for (int i = 0; i < ONLOOKERS_MAX; i++)
        memset(o->all[i].cursors, 0, sizeof o->all[i].cursors);
}

void onlookers_fini(struct onlookers *o) {
    for (int i = 0; i < ONLOOKERS_MAX; i++)
        free_place(&o->all[i]);
}

// The place of a tray, or a free one for NULL; NULL where there is none.
static struct onlooker *find(struct onlookers *o, const struct tray *tray) {
    for (int i = 0; i < ONLOOKERS_MAX; i++)
        if (o->all[i].tray == tray)
            return &o->all[i];
    return NULL;
}

void onlookers_hear(struct onlookers *o, const struct look *look,
                    const char *const groups[TISSUES_MAX], int count) {
    let_go(o);
    if (tray_is_left(look->tray))
        return;
    struct onlooker *onlooker = find(o, look->tray);
    if (!onlooker && (onlooker = find(o, NULL)))
        onlooker->tray = tray_hold(look->tray);
    for (int i = 0; onlooker && i < count; i++) {
        if (look->asks)
            mesh_cursor_ask(&onlooker->cursors[i], groups[i], &look->ask);
        else if (!strcmp(groups[i], look->ack.group))
            mesh_cursor_ack(&onlooker->cursors[i], &look->ack);
    }
}

void onlookers_serve(struct onlookers *o, uint64_t session,
                     struct mesh_feed *const feeds[TISSUES_MAX]) {
    let_go(o);
    for (int i = 0; i < ONLOOKERS_MAX; i++)
        for (int t = 0; o->all[i].tray && t < TISSUES_MAX; t++) {
            if (!feeds[t])
                continue;
            struct mesh_payload *payload = mesh_feed_next(feeds[t], &o->all[i].cursors[t]);
            if (payload)
                tray_put(o->all[i].tray, t, session, payload);
            mesh_payload_release(&payload);
        }
}
