#include "runtime/fair_share.h"

bool fair_share_take(struct fair_share *share, int64_t now_ns) {
    bool has_bytes = bucket_take(&share->bytes, FAIR_TRACE_BYTES_S, FAIR_TRACE_BYTES_BURST, now_ns);
    return has_bytes && bucket_take(&share->frames, FAIR_FRAMES_HZ, FAIR_FRAMES_BURST, now_ns);
}

void fair_share_record(struct fair_share *share, uint64_t trace_bytes) {
    if (trace_bytes > share->trace_bytes && share->trace_bytes)
        share->bytes.spent += (double)(trace_bytes - share->trace_bytes);
    share->trace_bytes = trace_bytes;
}
