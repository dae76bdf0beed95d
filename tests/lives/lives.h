// An attempt lives on: hands play a task in a session that is recorded, the server is killed at
// random steps and resumes the session from its trace, with a state that was kept or without, and
// in the end the trace is judged. In one process and in virtual time.
#pragma once

#include "judging/judging.h"
#include "motion/motion.h"
#include "task/task.h"

struct lives {
    uint64_t steps;
    int kills, kept; // and those after which it went on from a state that was kept
    int differences; // of the attempt, byte for byte: after each kill, and from the trace
    enum verdict verdict, traced_verdict;
    struct attempt attempt; // at its end
};

// trace: a file that does not exist; it is left there. kills: about so many. Results as
// site_create, task_parse and trace_writer_create.
enum result lives_run(const struct task_file *file, const struct scene *scene,
                      const struct motion *motion, double rate_hz, int kills, uint64_t seed,
                      const char *trace, struct lives *out, struct error *err);
