// Keys and values that stand behind a message's content from version 2 on, and what they say of
// tracked tools: as PLUS and 3D Slicer send it, whether a tool is seen, and its whole name where
// the protocol's 20 bytes are too few.
#pragma once

#include "igtl/framing.h"
#include "igtl/stream.h"

struct igtl_text {
    const char *bytes; // not ended by a 0
    size_t size;
};

// A way through them, which lie in the content's bytes.
struct igtl_entries {
    const uint8_t *index;
    const char *text;
    int left;
};

// RESULT_FORMAT: their sizes contradict each other.
enum result igtl_entries_begin(const struct igtl_content *content, struct igtl_entries *out_entries,
                               struct error *err);

bool igtl_entries_next(struct igtl_entries *entries, struct igtl_text *out_key,
                       struct igtl_text *out_value);

// Of a message of poses. A tool whose state is not "OK" is unseen. TRANSFORM and POSITION have
// TransformStatus and IGTL_DEVICE_NAME, TDATA and QTDATA NAMEStatus and, as the element's number,
// NAMEIndex.
enum result igtl_read_tool_metadata(const struct igtl_content *content,
                                    struct igtl_message *message, struct error *err);

// The same name, or one is cut after the 20 bytes of the protocol.
bool igtl_is_same_tool(const char *a, const char *b);
