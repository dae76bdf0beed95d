#include "made_state.h"

#include "base/check.h"
#include "unit/trace_files.h"

#include <openssl/sha.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#define PLACE_AT 165 // the offset of the place, in the bytes

static uint8_t *model;
static size_t model_size;

struct trace_header made_header(void) {
    return some_header();
}

static void make_model(void) {
    struct session_input input;
    struct session_output output;
    uint32_t content = 0;
    enum result result;
    make_folder(NULL);
    struct trace_writer *writer = start_writing();
    step_at(1, &input, &output);
    CHECK(trace_append(writer, &input, &output));
    struct trace_state state = {
        .output_hash = output.hash, .size = sizeof content, .content = (uint8_t *)&content};
    trace_place_behind(writer, trace_position(writer), &output, &state.place);
    while ((result = trace_state_write(path, &state, NULL)) == RESULT_MISSING)
        usleep(1000);
    CHECK(result == RESULT_OK && trace_state_load(path, &model, &model_size, NULL) == RESULT_OK);
    trace_writer_destroy(&writer);
    trace_state_remove(path);
    remove_folder(NULL);
}

uint8_t *made_state(uint64_t offset, uint32_t number, size_t *out_size) {
    struct trace_state parsed;
    if (!model)
        make_model();
    size_t summed = model_size - SHA256_DIGEST_LENGTH;
    uint8_t *bytes = alloc(model_size, 1);
    memcpy(bytes, model, model_size);
    memcpy(bytes + PLACE_AT, &offset, sizeof offset);
    memcpy(bytes + summed - sizeof number, &number, sizeof number);
    SHA256(bytes, summed, bytes + summed);
    CHECK(trace_state_parse(bytes, model_size, &parsed, NULL) == RESULT_OK &&
          parsed.place.offset == offset);
    *out_size = model_size;
    return bytes;
}
