#include "base/attempt_words.h"

#include <string.h>

static const char *const purposes[ATTEMPT_PURPOSE_COUNT] = {"practice", "exam"};
static const char *const hand_words[ATTEMPT_HAND_COUNT] = {"right", "left"};

const char *attempt_purpose_name(enum attempt_purpose purpose) {
    return purposes[purpose];
}

const char *attempt_hand_name(enum attempt_hand hand) {
    return hand_words[hand];
}

const char *verdict_name(enum verdict verdict) {
    static const char *const names[VERDICT_COUNT] = {"open", "passed", "not yet"};
    return names[verdict];
}

const char *attempt_end_name(enum attempt_end end) {
    static const char *const names[ATTEMPT_END_COUNT] = {"runs",           "done", "time out",
                                                         "sentinel error", "left", "stopped"};
    return names[end];
}

static int index_of(const char *const names[], int count, const char *name) {
    for (int i = 0; i < count; i++)
        if (!strcmp(names[i], name))
            return i;
    return -1;
}

int attempt_purpose_from(const char *name) {
    return index_of(purposes, ATTEMPT_PURPOSE_COUNT, name);
}

int attempt_hand_from(const char *name) {
    return index_of(hand_words, ATTEMPT_HAND_COUNT, name);
}
