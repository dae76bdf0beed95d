#include "trace_survey.h"

#include "base/clock.h"
#include "trace_commands.h"

#include <string.h>

static void count_input(const struct session_input *input, struct survey *s) {
    if (input->kind != INPUT_FRAME)
        return;
    s->frames++;
    for (int i = 0; i < input->frame.count; i++)
        s->lost_samples += input->frame.samples[i].validity == VALIDITY_LOST;
}

static void count_output(const struct session_output *output, struct survey *s) {
    if (s->steps++ == 0)
        s->first_ns = output->time_ns;
    s->last_ns = output->time_ns;
    s->state = output->state;
    s->jobs += output->job.id != 0;
    if (output->landed.job)
        s->tissues[output->landed.tissue] = output->landed.figures;
    for (int i = 0; i < EVENT_COUNT; i++)
        s->events[i] += output->events >> i & 1;
    for (int i = 0; i < INSTRUMENT_COUNT; i++) {
        if (!output->instruments[i].present)
            continue;
        s->present[i]++;
        s->largest_mm = fmax(s->largest_mm, vec3_length(output->instruments[i].warp.displacement));
    }
}

void survey_read(struct trace_reader *reader, struct survey *s) {
    memset(s, 0, sizeof *s);
    s->file_bytes = trace_reader_size(reader);
    struct trace_record record;
    while ((s->end = trace_read(reader, &record, &s->why)) == RESULT_OK) {
        if (record.type == TRACE_STEP) {
            count_input(&record.input, s);
            count_output(&record.output, s);
        }
        if (record.type == TRACE_GAP) {
            s->gaps++;
            s->missing += record.missing;
        }
        show_progress(trace_reader_offset(reader), s->file_bytes);
    }
    s->whole_bytes = trace_reader_offset(reader);
    if (s->file_bytes < s->whole_bytes) // it grew: the session goes on
        s->file_bytes = s->whole_bytes;
}

double survey_seconds(const struct survey *s) {
    return (double)(s->last_ns - s->first_ns) / (double)NS_PER_S;
}
