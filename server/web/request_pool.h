// Runs slow work on threads of a pool: the handler's answers, and pieces of files. Tasks are
// handed in and taken back done; the web thread waits for neither.
#pragma once

#include "web/answer.h"
#include "web/token.h"
#include "web/web.h"

#define REQUEST_POOL_WAITING_MAX 64 // requests, as many slow ones, and as many that wait for others

enum web_task_kind {
    WEB_TASK_ACCOUNT, // whose token it is
    WEB_TASK_REQUEST, // the answer to a request
    WEB_TASK_FILE     // the next piece of the answer's file
};

struct web_task {
    enum web_task_kind kind;
    void *owner; // the web thread's own; the pool does not look at it
    struct web_task *next;
    struct request_pool *pool;
    char token[WEB_TOKEN_MAX];
    char device[WEB_TOKEN_MAX], sign_on[WEB_TOKEN_MAX]; // empty: none
    struct web_account account;                         // whose the token is
    // WEB_TASK_ACCOUNT
    enum result entry;
    // WEB_TASK_REQUEST
    char method[8];
    char path[512];
    char query[8192];
    char host[WEB_HOST_MAX];
    char address[48];
    bool is_near;
    bool by_cookie;
    bool is_passed_on;
    bool takes_openmetrics;
    char *body; // owned; NULL: none
    size_t size;
    struct answer_options options;
    char downloader[64];                                          // the answer's owner; empty: none
    void (*later)(void *data, struct web_response *out_response); // as of a response
    void *later_data;
    // WEB_TASK_REQUEST, WEB_TASK_FILE
    struct answer answer;
    bool failed; // WEB_TASK_FILE: the file cannot be read
};

struct web_task *web_task_create(enum web_task_kind kind, void *owner);
void web_task_destroy(struct web_task **task); // NULL inside is fine; *task becomes NULL

struct request_pool;

// on_done(user) comes from any of the threads when a task can be taken; it may not block.
struct request_pool *request_pool_create(const struct web_handler *handler,
                                         void (*on_done)(void *user), void *user);

// Waits for the tasks that are running; the others are left undone.
void request_pool_stop(struct request_pool *pool);

// After request_pool_stop: releases all tasks. *pool becomes NULL.
void request_pool_destroy(struct request_pool **pool);

// Gives the task away. False where too many wait: it is the caller's still.
bool request_pool_add(struct request_pool *pool, struct web_task *task);

// A task that is done, the caller's now; NULL: none.
struct web_task *request_pool_take_done(struct request_pool *pool);
