#include "trace/player.h"

static bool tell_record(const struct trace_player *p, const struct trace_record *record) {
    if (p->record && !p->record(p->user, record))
        return false;
    switch (record->type) {
    case TRACE_STEP:
        return !p->step || p->step(p->user, record);
    case TRACE_PAST:
        return !p->past || p->past(p->user, record);
    case TRACE_TAKEN:
        return !p->taken || p->taken(p->user, record);
    case TRACE_STATE:
        return !p->state || !record->state || p->state(p->user, record->state);
    case TRACE_GAP:
        return !p->gap || p->gap(p->user, record->missing);
    case TRACE_RESUME:
        return !p->resume || p->resume(p->user, record->utc_ns);
    case TRACE_FAULT:
        return !p->fault || p->fault(p->user, record->utc_ns);
    case TRACE_REMARK:
        return !p->remark || p->remark(p->user, &record->remark);
    case TRACE_MARKER:
        return !p->marker || p->marker(p->user, &record->marker);
    case TRACE_BEGUN:
        return !p->begun || p->begun(p->user, &record->begun);
    case TRACE_ENDED:
        return !p->ended || p->ended(p->user, &record->ended);
    case TRACE_END:
        return !p->end || p->end(p->user, record->records, record->missing);
    case TRACE_TOUCH: // it comes again with the step at which it lands
        return true;
    }
    return true;
}

enum result trace_play(struct trace_reader *reader, const struct trace_player *player,
                       struct error *err) {
    struct trace_record record;
    enum result result;
    while ((result = trace_read(reader, &record, err)) == RESULT_OK) {
        bool goes_on = tell_record(player, &record);
        if (player->progress)
            player->progress(trace_reader_offset(reader), trace_reader_size(reader));
        if (!goes_on)
            return RESULT_OK;
    }
    return result;
}
