#include "records/waiting.h"

#include "base/check.h"

#include <stdlib.h>

static void link_last(struct waiting_list *list, struct waiting *waiting) {
    *(list->last ? &list->last->next : &list->first) = waiting;
    list->last = waiting;
}

void waiting_append(struct waiting_list *list, const struct waiting *from) {
    struct waiting *waiting = alloc(1, sizeof *waiting);
    *waiting = *from;
    waiting->next = NULL;
    link_last(list, waiting);
}

void waiting_put_before(struct waiting_list *list, struct waiting_list *head) {
    if (!head->first)
        return;
    head->last->next = list->first;
    list->first = head->first;
    if (!list->last)
        list->last = head->last;
    *head = (struct waiting_list){0};
}

struct waiting *waiting_take(struct waiting_list *list) {
    struct waiting *first = list->first;
    list->first = first->next;
    if (!list->first)
        list->last = NULL;
    return first;
}

void waiting_free(struct waiting *waiting) {
    if (waiting && waiting->kind == WAITING_SCORE)
        session_score_fini(&waiting->score);
    if (waiting && waiting->kind == WAITING_ATTEMPT)
        free(waiting->attempt);
    free(waiting);
}

void waiting_clear(struct waiting_list *list) {
    while (list->first)
        waiting_free(waiting_take(list));
}
