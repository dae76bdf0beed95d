// An attempt: one trial of a task, a span of a session's steps. It is judged from the steps'
// outputs alone, so live, after a restart and from the trace the same bits come out.
//
// struct attempt has constant size and no pointers, so an assignment copies it. Nothing here
// allocates, fails or reads a clock.
#pragma once

#include "base/attempt_words.h"
#include "step/session.h"
#include "task/site.h"

// A tracker's noise makes a condition come and go. So it counts as held until it has not held for
// HELD_NS; an error that was counted, until it has missed its bounds by more than that noise for
// ERROR_APART_NS.
#define HELD_NS 150000000LL
#define ERROR_APART_NS 500000000LL

#define ATTEMPT_OCCURRENCES_MAX 64 // that are kept with their steps; all are counted

// All times are of the running session since the attempt began; what was paused does not count.
struct holding {
    bool holds;
    int64_t since_ns, last_ns;
};

struct goal_state {
    struct holding hold;
    bool met;
    uint64_t met_step;
    int64_t met_ns;
    vec3 from;     // the scope's tip when the goal began to hold
    int32_t along; // of a line: the points that were passed
};

struct error_state {
    struct holding hold;
    bool counted;
    int32_t count;
    vec3 at; // the tip where one of the error's groups was nearest last
};

struct occurrence {
    int32_t error; // index in the task
    int32_t tool;  // of the session's instruments; -1: of none in particular
    uint64_t step;
    int64_t time_ns;
};

// What makes the next step's answers cheap, and changes none.
struct goal_hints {
    int32_t shown;                               // of the landmark's points, the one seen last
    struct sight_hint hidden_by[SITE_SHOWN_MAX]; // of each point
};

struct attempt {
    uint64_t first_step, last_step;
    int64_t running_ns;
    int64_t last_ns; // of the clock of the steps
    bool running;
    enum attempt_end end;
    int32_t goals_met, errors;
    vec3 tips[INSTRUMENT_COUNT];
    double speeds[INSTRUMENT_COUNT]; // mm/s, smoothed
    bool seen[INSTRUMENT_COUNT];     // there was a tip at the step before
    vec3 stood;   // the scope's tip when the last goal was met, or from where it was held again
    uint32_t cut; // a bit for each tissue of which something was cut
    struct quality_report resections[TISSUES_MAX];
    struct goal_state goals[TASK_GOALS_MAX];
    struct error_state found[TASK_ERRORS_MAX][INSTRUMENT_COUNT]; // of each tool
    int32_t occurrence_count;
    struct occurrence occurrences[ATTEMPT_OCCURRENCES_MAX];
    struct goal_hints hints[TASK_GOALS_MAX]; // last
};

// What a step brought: bit i of goals_met for goal i.
struct attempt_news {
    uint32_t goals_met, errors;
    bool ended;
};

// The same bits, but for the hints.
bool attempt_is_same(const struct attempt *a, const struct attempt *b);

// It begins with the next step.
void attempt_init(struct attempt *attempt);

// Adds the session's next step, and the kind of its input: a reset stops the attempt.
// Nothing changes once it has ended.
struct attempt_news attempt_take(struct attempt *attempt, const struct site *site,
                                 enum input_kind kind, const struct session_output *output);
// The same for a step that was no reset.
struct attempt_news attempt_step(struct attempt *attempt, const struct site *site,
                                 const struct session_output *output);

// The same for a step of which only its input and what landed are at hand: of another server.
void attempt_pass(struct attempt *attempt, enum input_kind kind, int64_t time_ns,
                  const struct landed *landed);

// ATTEMPT_LEFT or ATTEMPT_STOPPED, unless it has ended.
void attempt_leave(struct attempt *attempt, bool by_trainee);
// What a trace says that no step does: it was left or stopped.
void attempt_end_as(struct attempt *attempt, enum attempt_end recorded);

// By the task's pass mark: VERDICT_OPEN while it runs.
enum verdict attempt_verdict(const struct attempt *attempt, const struct task *task);
// By another one.
enum verdict attempt_verdict_by(const struct attempt *attempt, double pass_time_s, int pass_errors);
// How often an error was counted, with any tool.
uint32_t attempt_error_count(const struct attempt *attempt, int error);
double attempt_time_s(const struct attempt *attempt);
