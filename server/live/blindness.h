// Which accounts must not learn the names of which trainees now: their blind raters. The list is
// read on a thread of commands each two seconds while pages look on, so that no page waits for the
// records.
#pragma once

#include "live/account.h"

#include <pthread.h>
#include <stdint.h>

struct task_pool;

#define BLIND_PAIRS_MAX 1024

struct blindness {
    each_blind *each; // NULL: there are none
    void *user;
    pthread_mutex_t mutex; // of all below
    bool known;            // since the list was first read; else everybody is blind
    bool reading;
    int64_t read_ns;
    int count;
    struct blind_pair {
        char account[64], trainee[64];
    } pairs[BLIND_PAIRS_MAX];
};

void blindness_init(struct blindness *blindness, each_blind *each, void *user); // reads once
void blindness_fini(struct blindness *blindness);
void blindness_renew(struct blindness *blindness, struct task_pool *pool, int64_t now_ns);
// From any thread. A name that is empty is known to all.
bool is_blind_to(struct blindness *blindness, const char *account, const char *trainee);
