#include "message_rows.h"

// "\x12" "..." splits keep a hexadecimal escape from taking the next character.
#define ROW(what, kind, result, bytes)                                                             \
    { what, kind, result, bytes, sizeof bytes - 1, 0, 0 }
#define LONG(what, kind, result, bytes, more, filler)                                              \
    { what, kind, result, bytes, sizeof bytes - 1, more, filler }

const struct message_row message_rows[] = {
    ROW("nothing", KIND_CONTROL, RESULT_OK, ""),
    ROW("a message of an unknown kind", KIND_CONTROL, RESULT_OK, "\xa2\x06\x01x"),
    ROW("an unknown number beside a ping", KIND_CONTROL, RESULT_OK, "\x22\x00\xa0\x06\x05"),
    ROW("an unknown field in a ping", KIND_CONTROL, RESULT_OK, "\x22\x03\x72\x01x"),
    ROW("field number 0", KIND_CONTROL, RESULT_FORMAT, "\x02\x00"),
    ROW("a group", KIND_CONTROL, RESULT_FORMAT, "\x23\x24"),
    ROW("wire type 7", KIND_CONTROL, RESULT_FORMAT, "\x27"),
    ROW("a ping that is a number", KIND_CONTROL, RESULT_FORMAT, "\x20\x01"),
    ROW("a ping longer than the data", KIND_CONTROL, RESULT_FORMAT, "\x22\x09\x09"),
    ROW("a length of 2^32 - 1", KIND_CONTROL, RESULT_FORMAT, "\x22\xff\xff\xff\xff\x0f"),
    ROW("a length of 2^64 - 1", KIND_CONTROL, RESULT_FORMAT,
        "\x22\xff\xff\xff\xff\xff\xff\xff\xff\xff\x01"),
    ROW("a number of eleven bytes", KIND_CONTROL, RESULT_FORMAT,
        "\x0a\x0c\x08\xff\xff\xff\xff\xff\xff\xff\xff\xff\xff\x01"),
    ROW("a version of 33 bits", KIND_CONTROL, RESULT_FORMAT, "\x0a\x06\x08\x80\x80\x80\x80\x10"),
    ROW("keys of 15 bytes", KIND_CONTROL, RESULT_FORMAT,
        "\x42\x11\x22\x0f"
        "123456789012345"),
    ROW("keys of 17 bytes", KIND_CONTROL, RESULT_FORMAT,
        "\x42\x13\x22\x11"
        "12345678901234567"),
    ROW("a station's name of 63 letters", KIND_CONTROL, RESULT_OK,
        "\x0a\x41\x22\x3f"
        "aaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaa"),
    ROW("a station's name of 64 letters", KIND_CONTROL, RESULT_FORMAT,
        "\x0a\x42\x22\x40"
        "aaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaa"),
    ROW("a capability of 24 letters", KIND_CONTROL, RESULT_FORMAT,
        "\x0a\x1a\x1a\x18"
        "abcdefghijklmnopqrstuvwx"),
    ROW("16 empty capabilities", KIND_CONTROL, RESULT_OK,
        "\x0a\x20\x1a\x00\x1a\x00\x1a\x00\x1a\x00\x1a\x00\x1a\x00\x1a\x00\x1a\x00"
        "\x1a\x00\x1a\x00\x1a\x00\x1a\x00\x1a\x00\x1a\x00\x1a\x00\x1a\x00"),
    ROW("17 empty capabilities", KIND_CONTROL, RESULT_FORMAT,
        "\x0a\x22\x1a\x00\x1a\x00\x1a\x00\x1a\x00\x1a\x00\x1a\x00\x1a\x00\x1a\x00"
        "\x1a\x00\x1a\x00\x1a\x00\x1a\x00\x1a\x00\x1a\x00\x1a\x00\x1a\x00\x1a\x00"),
    ROW("8 meshes", KIND_CONTROL, RESULT_OK,
        "\x6a\x10\x0a\x00\x0a\x00\x0a\x00\x0a\x00\x0a\x00\x0a\x00\x0a\x00\x0a\x00"),
    ROW("9 meshes", KIND_CONTROL, RESULT_FORMAT,
        "\x6a\x12\x0a\x00\x0a\x00\x0a\x00\x0a\x00\x0a\x00\x0a\x00\x0a\x00\x0a\x00\x0a\x00"),
    LONG("a mesh's name of 63 letters", KIND_CONTROL, RESULT_OK, "\x72\x41\x0a\x3f", 63, 'm'),
    LONG("a mesh's name of 64 letters", KIND_CONTROL, RESULT_FORMAT, "\x72\x42\x0a\x40", 64, 'm'),
    LONG("a request of 2048 bytes", KIND_CONTROL, RESULT_OK, "\x5a\x83\x10\x12\x80\x10", 2048, 0),
    LONG("a request of 2049 bytes", KIND_CONTROL, RESULT_FORMAT, "\x5a\x84\x10\x12\x81\x10", 2049,
         0),
    LONG("a control message of 8192 bytes", KIND_CONTROL, RESULT_OK, "\xa2\x06\xfc\x3f", 8188, 0),
    LONG("a control message of 8193 bytes", KIND_CONTROL, RESULT_LIMIT, "\xa2\x06\xfd\x3f", 8189,
         0),
    LONG("a console message of 65536 bytes", KIND_CONSOLE, RESULT_OK, "\xa2\x06\xfb\xff\x03", 65531,
         0),
    LONG("a console message of 65537 bytes", KIND_CONSOLE, RESULT_LIMIT, "\xa2\x06\xfc\xff\x03",
         65532, 0),
    LONG("65 sessions", KIND_CONSOLE, RESULT_FORMAT,
         "\x12\x82\x01\x1a\x00\x1a\x00\x1a\x00\x1a\x00\x1a\x00\x1a\x00\x1a\x00\x1a\x00\x1a\x00"
         "\x1a\x00\x1a\x00\x1a\x00\x1a\x00\x1a\x00\x1a\x00\x1a\x00\x1a\x00\x1a\x00\x1a\x00\x1a\x00"
         "\x1a\x00\x1a\x00\x1a\x00\x1a\x00\x1a\x00\x1a\x00\x1a\x00\x1a\x00\x1a\x00\x1a\x00\x1a\x00"
         "\x1a\x00\x1a\x00\x1a\x00\x1a\x00\x1a\x00\x1a\x00\x1a\x00\x1a\x00\x1a\x00\x1a\x00\x1a\x00"
         "\x1a\x00\x1a\x00\x1a\x00\x1a\x00\x1a\x00\x1a\x00\x1a\x00\x1a\x00\x1a\x00\x1a\x00\x1a\x00"
         "\x1a\x00\x1a\x00\x1a\x00\x1a\x00\x1a\x00\x1a\x00\x1a\x00\x1a\x00\x1a\x00\x1a\x00\x1a\x00"
         "\x1a\x00",
         0, 0),
    LONG("22 empty samples", KIND_FRAME, RESULT_OK,
         "\x1a\x00\x1a\x00\x1a\x00\x1a\x00\x1a\x00\x1a\x00\x1a\x00\x1a\x00"
         "\x1a\x00\x1a\x00\x1a\x00\x1a\x00\x1a\x00\x1a\x00"
         "\x1a\x00\x1a\x00\x1a\x00\x1a\x00\x1a\x00\x1a\x00\x1a\x00\x1a\x00",
         0, 0),
    LONG("23 empty samples", KIND_FRAME, RESULT_FORMAT,
         "\x1a\x00\x1a\x00\x1a\x00\x1a\x00\x1a\x00\x1a\x00\x1a\x00\x1a\x00\x1a\x00"
         "\x1a\x00\x1a\x00\x1a\x00\x1a\x00\x1a\x00\x1a\x00"
         "\x1a\x00\x1a\x00\x1a\x00\x1a\x00\x1a\x00\x1a\x00\x1a\x00\x1a\x00",
         0, 0),
    LONG("padding of 1408 bytes", KIND_FRAME, RESULT_OK, "\x22\x80\x0b", 1408, 1),
    LONG("padding of 1409 bytes", KIND_FRAME, RESULT_FORMAT, "\x22\x81\x0b", 1409, 1),
    LONG("a frame of 1453 bytes", KIND_FRAME, RESULT_LIMIT, "\xa2\x06\xa9\x0b", 1449, 0),
    ROW("a joint and a pose in one sample: the last counts", KIND_FRAME, RESULT_OK,
        "\x1a\x04\x2a\x00\x32\x00"),
    ROW("channel 12", KIND_FRAME, RESULT_FORMAT, "\x1a\x02\x08\x0c"),
    ROW("channel 2^32 + 1", KIND_FRAME, RESULT_FORMAT, "\x1a\x06\x08\x81\x80\x80\x80\x10"),
    ROW("a pose with half a number", KIND_FRAME, RESULT_FORMAT,
        "\x1a\x07\x32\x05\x09\x01\x02\x03\x04"),
    ROW("6 lost instruments", KIND_REPLY, RESULT_FORMAT,
        "\x22\x04\x08\x04\x10\x02\x22\x04\x08\x04\x10\x02\x22\x04\x08\x04\x10\x02"
        "\x22\x04\x08\x04\x10\x02\x22\x04\x08\x04\x10\x02\x22\x04\x08\x04\x10\x02"),
    ROW("5 lost instruments", KIND_REPLY, RESULT_OK,
        "\x22\x04\x08\x04\x10\x02\x22\x04\x08\x04\x10\x02\x22\x04\x08\x04\x10\x02"
        "\x22\x04\x08\x04\x10\x02\x22\x04\x08\x04\x10\x02"),
    ROW("an instrument without a pose", KIND_REPLY, RESULT_FORMAT, "\x22\x02\x08\x04"),
    ROW("2 corrections", KIND_REPLY, RESULT_FORMAT, "\x32\x00\x32\x00"),
    ROW("3 corrections", KIND_REPLY, RESULT_FORMAT, "\x32\x00\x32\x00\x32\x00"),
    ROW("2 loose bodies that are out", KIND_REPLY, RESULT_OK, "\x5a\x02\x10\x02\x5a\x02\x10\x02"),
    ROW("3 loose bodies", KIND_REPLY, RESULT_FORMAT,
        "\x5a\x02\x10\x02\x5a\x02\x10\x02\x5a\x02\x10\x02"),
    ROW("a loose body that lies nowhere", KIND_REPLY, RESULT_FORMAT, "\x5a\x00"),
    LONG("a slope of 24", KIND_REPLY, RESULT_OK, "\x22\x68\x08\x04\x10\x02\x4a\x62\x2a\x60", 96, 0),
    LONG("a slope of 25", KIND_REPLY, RESULT_FORMAT, "\x22\x6c\x08\x04\x10\x02\x4a\x66\x2a\x64",
         100, 0),
    LONG("a slope of 9 and a half", KIND_REPLY, RESULT_FORMAT,
         "\x22\x2e\x08\x04\x10\x02\x4a\x28\x2a\x26", 38, 0),
    LONG("a portal of 4", KIND_REPLY, RESULT_FORMAT, "\x22\x18\x08\x04\x10\x02\x4a\x12\x12\x10", 16,
         0),
    LONG("a gradient of an earlier version", KIND_REPLY, RESULT_OK,
         "\x22\x2a\x08\x04\x10\x02\x32\x24", 36, 0),
    ROW("a subscription", KIND_PAGE, RESULT_OK, "\x0a\x02\x08\x01"),
    ROW("an unknown subscription", KIND_PAGE, RESULT_FORMAT, "\x0a\x02\x08\x04"),
    ROW("what a page has drawn", KIND_PAGE, RESULT_OK, "\x12\x09\x09\x05\0\0\0\0\0\0\0"),
    ROW("what it has drawn, cut short", KIND_PAGE, RESULT_FORMAT, "\x12\x09\x09\x05"),
    ROW("a page's command", KIND_PAGE, RESULT_OK, "\x1a\x02\x08\x01"),
    ROW("a page's unknown command", KIND_PAGE, RESULT_FORMAT, "\x1a\x02\x08\x7f"),
    ROW("a page's copy of a session", KIND_PAGE, RESULT_OK,
        "\x1a\x24\x08\x08\x22\x20"
        "0123456789abcdef0123456789abcdef"),
    ROW("a page's copy of a file, which a reply refuses", KIND_PAGE, RESULT_OK,
        "\x1a\x0f\x08\x08\x22\x0b"
        "/etc/passwd"),
    LONG("a page's message of 4096 bytes", KIND_PAGE, RESULT_OK, "\xa2\x06\xfc\x1f", 4092, 0),
    LONG("a page's message of 4097 bytes", KIND_PAGE, RESULT_LIMIT, "\xa2\x06\xfd\x1f", 4093, 0),
};

const int message_row_count = sizeof message_rows / sizeof *message_rows;
