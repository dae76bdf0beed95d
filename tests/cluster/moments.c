#include "moments.h"

#include "base/check.h"

#include <stdlib.h>

#define OFFSET 1000 // of the first record in a trace

uint32_t moments_add(struct moments *m, uint32_t before, enum moment_kind kind) {
    if (m->count == m->room) {
        m->room = 2 * m->room + 1024;
        m->of = alloc_resize(m->of, m->room, sizeof *m->of);
    }
    uint32_t id = m->count++;
    struct moment one = {before, id, 0, 0, kind, false, false};
    if (kind != MOMENT_ROOT) {
        const struct moment *last = &m->of[before];
        one.root = last->root;
        one.count = last->count + 1;
        one.remarks = last->remarks + (kind == MOMENT_REMARK);
    }
    m->of[id] = one;
    return id;
}

bool moments_follow(const struct moments *m, uint32_t early, uint32_t late) {
    while (m->of[late].count > m->of[early].count)
        late = m->of[late].before;
    return early == late;
}

struct moment *moments_root(const struct moments *m, uint32_t moment) {
    return &m->of[m->of[moment].root];
}

uint64_t moments_offset(const struct moments *m, uint32_t moment) {
    return OFFSET + m->of[moment].count;
}

void moments_tell(const struct moments *m, uint32_t id, struct journal_writer *writer) {
    struct trace_record record = {.type = TRACE_STEP, .offset = moments_offset(m, id)};
    if (m->of[id].kind == MOMENT_REMARK) {
        record.type = TRACE_REMARK;
        record.remark =
            (struct remark){.number = 1, .time_ns = id, .author = "ada", .text = "well"};
    } else if (m->of[id].kind == MOMENT_COMMAND) {
        record.input = (struct session_input){.kind = INPUT_PAUSE, .time_ns = id};
    } else {
        record.output.job = (struct job){.id = id, .kind = JOB_UNDO};
        journal_record(writer, &record);
        record.output.job.id = 0;
        record.output.landed.job = record.input.job = id;
        record.input.kind = INPUT_JOB;
        record.job_done = true;
    }
    journal_record(writer, &record);
}

static uint32_t moment_of(const struct trace_record *record) {
    switch (record->type) {
    case TRACE_REMARK:
        return (uint32_t)record->remark.time_ns;
    case TRACE_PAST:
        return (uint32_t)record->input.time_ns;
    default:
        return (uint32_t)record->output.job.id;
    }
}

// Puts each record behind the state at its place; true where they follow from one another.
bool moments_join(const struct moments *m, struct journal_reader *reader, uint32_t *in_out) {
    uint32_t from = *in_out, count = m->of[from].count, remarks = 0, last = 0;
    uint32_t *of = alloc(m->count + 1, sizeof *of); // by number behind the state
    struct trace_record record;
    bool joins = true;
    while (joins && journal_next_record(reader, &record, NULL) == RESULT_OK) {
        uint32_t id = moment_of(&record);
        joins = id < m->count;
        uint32_t number = joins ? m->of[id].count : 0;
        if (number <= count)
            remarks += joins && m->of[id].kind == MOMENT_REMARK && moments_follow(m, id, from);
        else
            of[number - count] = id;
        last = number > count + last ? number - count : last;
    }
    joins = joins && remarks == m->of[from].remarks;
    for (uint32_t i = 1; joins && i <= last; i++) {
        joins = of[i] && m->of[of[i]].before == *in_out;
        *in_out = of[i];
    }
    free(of);
    return joins;
}
