// How often somebody may try to sign in. Wrong tries count
//
// - in a browser where this person has signed in before: by its device cookie alone,
// - elsewhere: by address and name together, by name, and by address.
//
// The limits by address are mild, because a hall may have one address. A name has more tries than
// one address can use up. So wrong tries keep out neither the hall, nor the owner of a name at
// another address, nor anybody in a browser that is known.
#pragma once

#include "api/call.h"

#define TRIES_KEYS_MAX 3

struct tries {
    char keys[TRIES_KEYS_MAX][STORE_NAME_MAX + 80];
    const struct throttle_rule *rules[TRIES_KEYS_MAX];
    int count;
    int64_t begun_ns;
};

// Counts a try as wrong until tries_was_right. name: of the account; NULL: with a code or a link.
// False after a refusal (429).
bool tries_begin(struct api_call *call, const char *name, struct tries *out);
void tries_was_right(struct api_call *call, const struct tries *tries);

// Limits how often one person signs in. False after a refusal.
bool tries_may_enter(struct api_call *call, const char *actor);
void tries_entered(struct api_call *call, const char *actor);

// Notes a wrong try in the audit log: in an hour the first, the second, the fourth, the eighth ...
// of one subject. action: "wrong password"; subject: "account 3".
void tries_note_wrong(struct api_call *call, const char *action, const char *subject);
