#include "hub/tray.h"

#include "base/check.h"

#include <stdatomic.h>
#include <stdlib.h>

struct dish {
    uint64_t session;
    struct mesh_payload *payload;
};

struct tray {
    atomic_int references;
    atomic_bool left;
    void (*ring)(void *user);
    void *user;
    _Atomic(struct dish *) dishes[TISSUES_MAX];
};

struct tray *tray_create(void (*ring)(void *user), void *user) {
    struct tray *tray = alloc(1, sizeof *tray);
    atomic_init(&tray->references, 1);
    tray->ring = ring;
    tray->user = user;
    return tray;
}

struct tray *tray_hold(struct tray *tray) {
    atomic_fetch_add(&tray->references, 1);
    return tray;
}

static void clear(struct dish *dish) {
    if (dish)
        mesh_payload_release(&dish->payload);
    free(dish);
}

void tray_release(struct tray **tray) {
    struct tray *t = *tray;
    *tray = NULL;
    if (!t || atomic_fetch_sub(&t->references, 1) > 1)
        return;
    for (int i = 0; i < TISSUES_MAX; i++)
        clear(atomic_load(&t->dishes[i]));
    free(t);
}

void tray_leave(struct tray *tray) {
    atomic_store(&tray->left, true);
}

bool tray_is_left(const struct tray *tray) {
    return atomic_load(&tray->left);
}

void tray_put(struct tray *tray, int tissue, uint64_t session, struct mesh_payload *payload) {
    struct dish *dish = alloc(1, sizeof *dish);
    *dish = (struct dish){session, mesh_payload_hold(payload)};
    clear(atomic_exchange(&tray->dishes[tissue], dish));
    tray->ring(tray->user);
}

struct mesh_payload *tray_take(struct tray *tray, int tissue, uint64_t *out_session) {
    struct dish *dish = atomic_exchange(&tray->dishes[tissue], NULL);
    if (!dish)
        return NULL;
    struct mesh_payload *payload = dish->payload;
    *out_session = dish->session;
    free(dish);
    return payload;
}
