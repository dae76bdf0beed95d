// A message on the control connection or the console's.
#include "base/check.h"
#include "fuzz/fuzz.h"
#include "wire/wire.h"

// What is let through is good.
static void described(const arthron_Hello *hello) {
    struct instruments told, good = *instruments_usual();
    struct error err;
    CHECK(wire_instruments_to(hello, &told, &err) == RESULT_OK);
    for (int i = INSTRUMENTS_USUAL; i < told.count; i++)
        CHECK(instruments_add(&good, &told.of[i], &err) == RESULT_OK);
}

static void control(const uint8_t *data, size_t size) {
    static arthron_Control message, again;
    static uint8_t encoded[WIRE_CONTROL_MAX];
    struct error err;
    struct frame frame;
    size_t used;
    if (wire_decode_control(data, size, &message, &err) != RESULT_OK)
        return;
    if (message.which_message == arthron_Control_frame_tag &&
        wire_frame_to(&message.message.frame, &frame, &err) == RESULT_OK)
        CHECK(frame_is_valid(&frame));
    if (message.which_message == arthron_Control_hello_tag)
        described(&message.message.hello);
    CHECK(wire_encode_control(&message, encoded, sizeof encoded, &used) == RESULT_OK);
    CHECK(wire_decode_control(encoded, used, &again, &err) == RESULT_OK);
    CHECK(again.which_message == message.which_message);
}

static void console(const uint8_t *data, size_t size) {
    static arthron_Console message, again;
    static uint8_t encoded[WIRE_CONSOLE_MAX];
    struct error err;
    size_t used;
    if (wire_decode_console(data, size, &message, &err) != RESULT_OK)
        return;
    CHECK(wire_encode_console(&message, encoded, sizeof encoded, &used) == RESULT_OK);
    CHECK(wire_decode_console(encoded, used, &again, &err) == RESULT_OK);
    CHECK(again.which_message == message.which_message);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    control(data, size);
    console(data, size);
    return 0;
}
