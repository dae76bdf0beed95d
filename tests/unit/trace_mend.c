#include "unit/trace_mend.h"

#include "base/bytes.h"
#include "trace/record.h"

#include <string.h>
#include <xxhash.h>

// Of what lies in data[0 .. checked), behind it.
static void mend(struct chain *chain, unsigned version, uint8_t *data, size_t checked) {
    struct writer w = {data, checked + TRACE_HASH_SIZE, checked, false};
    if (version < 3) {
        write_u64(&w, XXH3_64bits(data, checked));
        return;
    }
    chain_add(chain, data, checked);
    memcpy(data + checked, chain->value, sizeof chain->value);
}

void trace_mend(uint8_t *data, size_t size) {
    struct chain chain;
    struct reader r = {data, size, 0, false};
    read_bytes(&r, 8); // the magic, where there is so much
    unsigned version = read_u16(&r);
    size_t at = 0, checked = HEADER_PREFIX + (size_t)read_u32(&r);
    chain_init(&chain);
    while (!r.underflow && size - at >= checksum_size(version) &&
           checked <= size - at - checksum_size(version)) {
        mend(&chain, version, data + at, checked);
        at += checked + checksum_size(version);
        r = (struct reader){data, size, at, false};
        checked = RECORD_PREFIX + (size_t)read_u32(&r);
    }
    chain_fini(&chain);
}
