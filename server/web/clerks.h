// The threads that ask the handler what may take time. Jobs are handed in and taken back done; the
// web thread waits for neither.
#pragma once

#include "web/answer.h"
#include "web/door.h"
#include "web/web.h"

#define CLERKS_WAITING_MAX 64 // requests

enum job_kind {
    JOB_ENTER,   // whose token is it?
    JOB_REQUEST, // what is the answer?
    JOB_READ     // the next piece of the answer's file
};

struct job {
    enum job_kind kind;
    void *owner; // the web thread's own; the clerks do not look at it
    struct job *next;
    char token[DOOR_TOKEN_MAX];
    // JOB_ENTER
    enum result entry;
    struct web_account account;
    // JOB_REQUEST
    char method[8];
    char path[512];
    char query[2048];
    char address[48];
    bool by_cookie;
    char *body; // owned; NULL: none
    size_t size;
    struct wishes wishes;
    // JOB_REQUEST, JOB_READ
    struct answer answer;
    bool failed; // JOB_READ: the file cannot be read
};

struct job *job_create(enum job_kind kind, void *owner);
void job_destroy(struct job **job); // NULL inside is fine; *job becomes NULL

struct clerks;

// on_done(user) comes from any of the threads when a job can be taken; it may not block.
struct clerks *clerks_create(const struct web_handler *handler, void (*on_done)(void *user),
                             void *user);

// Waits for the jobs that are being done; the others are left undone.
void clerks_stop(struct clerks *clerks);

// After clerks_stop: forgets all jobs. *clerks becomes NULL.
void clerks_destroy(struct clerks **clerks);

// Gives the job away. False where too many requests wait: it is the caller's still.
bool clerks_give(struct clerks *clerks, struct job *job);

// A job that is done, the caller's now; NULL: none.
struct job *clerks_take(struct clerks *clerks);
