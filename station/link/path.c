#include "link/path.h"

#include "base/clock.h"

#define PATIENCE_NS (300 * NS_PER_MS) // beyond twice the usual way
#define WAY_MEMORY 128                // answers
#define TRIAL_NS NS_PER_S
#define TRIAL_AFTER_ANSWER_NS (100 * NS_PER_MS)
#define TRIALS_NEEDED 3

void path_refused(struct path *path, int64_t now_ns) {
    *path = (struct path){.next_trial_ns = now_ns + TRIAL_NS, .way_ns = path->way_ns};
}

static bool is_trial_due(struct path *path, int64_t now_ns) {
    if (now_ns < path->next_trial_ns)
        return false;
    if (path->trial_open)
        path->trials_answered = 0;
    path->trial_open = true;
    path->next_trial_ns = now_ns + TRIAL_NS;
    return true;
}

struct frame_route path_next(struct path *path, int64_t now_ns) {
    int64_t patience_ns = PATIENCE_NS + 2 * path->way_ns;
    if (path->datagrams && path->unanswered_ns && now_ns - path->unanswered_ns > patience_ns)
        path_refused(path, now_ns);
    if (!path->datagrams)
        return (struct frame_route){.control = true, .datagram = is_trial_due(path, now_ns)};
    if (!path->unanswered_ns)
        path->unanswered_ns = now_ns;
    return (struct frame_route){.datagram = true};
}

// The longest way counts at once, and is forgotten slowly.
static void note_way(struct path *path, int64_t way_ns) {
    if (way_ns < 0)
        way_ns = 0;
    if (way_ns > PATH_WAY_MAX_NS)
        way_ns = PATH_WAY_MAX_NS;
    path->way_ns =
        way_ns > path->way_ns ? way_ns : path->way_ns - (path->way_ns - way_ns) / WAY_MEMORY;
}

void path_answered(struct path *path, int64_t sent_ns, int64_t now_ns) {
    path->unanswered_ns = 0;
    note_way(path, now_ns - sent_ns);
    if (path->datagrams || !path->trial_open)
        return;
    path->trial_open = false;
    path->next_trial_ns = now_ns + TRIAL_AFTER_ANSWER_NS;
    path->datagrams = ++path->trials_answered == TRIALS_NEEDED;
}
