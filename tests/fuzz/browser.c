// What a page says over /live, and the texts that a browser sends with a request.
#include "base/check.h"
#include "fuzz/fuzz.h"
#include "web/answer.h"
#include "web/host_check.h"
#include "web/token.h"

#include <pb_encode.h>
#include <string.h>

static void page(const uint8_t *data, size_t size) {
    static arthron_Page message, again;
    static uint8_t encoded[WIRE_PAGE_MAX];
    struct error err;
    if (wire_decode_page(data, size, &message, &err) != RESULT_OK)
        return;
    pb_ostream_t stream = pb_ostream_from_buffer(encoded, sizeof encoded);
    CHECK(pb_encode(&stream, arthron_Page_fields, &message));
    CHECK(wire_decode_page(encoded, stream.bytes_written, &again, &err) == RESULT_OK);
    CHECK(again.which_message == message.which_message);
}

static void texts(const char *text) {
    static struct host_check *hosts;
    if (!hosts)
        host_check_create(NULL, (const char *const[]){NULL}, &hosts, NULL);
    char token[WEB_TOKEN_MAX];
    int64_t from, to;
    if (token_of_cookies(text, token) || token_of_authorization(text, token))
        CHECK(token[0] && !strpbrk(token, " ;,\"\r\n"));
    host_check_is_origin(hosts, text, "localhost:4880");
    for (int64_t size = 0; size < 3000; size += 999)
        if (range_parse(text, size, &from, &to) == RANGE_SOME)
            CHECK(from >= 0 && from < to && to <= size);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    char text[512];
    size_t length = size < sizeof text ? size : sizeof text - 1;
    memcpy(text, data, length);
    text[length] = '\0';
    page(data, size);
    texts(text);
    return 0;
}
