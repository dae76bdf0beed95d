#include "export/image.h"

#include "base/check.h"
#include "base/draft.h"

#include <errno.h>
#include <openexr.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#define ZIP_LEVEL 4 // with which OpenEXR's own C++ library writes too

struct part {
    uint32_t width, height;
    int channel_count;
    struct image_channel *channels;
};

struct image_writer {
    exr_context_t file;
    struct draft draft;
    char *path;
    struct part *parts;
    int part_count;
    int part;     // that the next row belongs to
    uint32_t row; // its number
    exr_encode_pipeline_t pipeline;
    int *sources; // of each channel in the file's order: its place among those given
    enum result result;
    struct error why;
};

// The first failure with its details; OpenEXR would print it.
static void note_failure(exr_const_context_t file, exr_result_t code, const char *message) {
    void *data = NULL;
    (void)code;
    exr_get_user_data(file, &data);
    struct image_writer *writer = data;
    if (writer && !writer->why.text[0])
        fail(&writer->why, RESULT_IO, "%s: %s", writer->path, message);
}

static bool good(const struct image_writer *writer) {
    return writer->result == RESULT_OK;
}

static void expect(struct image_writer *writer, exr_result_t code) {
    if (code == EXR_ERR_SUCCESS || !good(writer))
        return;
    writer->result = RESULT_IO;
    if (!writer->why.text[0])
        fail(&writer->why, RESULT_IO, "%s: %s", writer->path, exr_get_default_error_message(code));
}

// OpenEXR's own writing tries a full disk again and again.
static int64_t write_at(exr_const_context_t file, void *data, const void *bytes, uint64_t size,
                        uint64_t offset, exr_stream_error_func_ptr_t tell) {
    struct image_writer *writer = data;
    (void)file, (void)tell;
    for (uint64_t done = 0; done < size;) {
        ssize_t got = pwrite(fileno(writer->draft.file), (const char *)bytes + done, size - done,
                             (off_t)(offset + done));
        if (got < 0 && errno == EINTR)
            continue;
        if (got <= 0) {
            writer->draft.trouble = got < 0 ? errno : ENOSPC;
            if (!writer->why.text[0])
                fail(&writer->why, RESULT_IO, "%s: %s", writer->path,
                     strerror(writer->draft.trouble));
            return -1;
        }
        done += (uint64_t)got;
    }
    return (int64_t)size;
}

bool image_writer_is_good(const struct image_writer *writer) {
    return good(writer);
}

struct image_writer *image_writer_create(const char *path) {
    struct image_writer *writer = alloc(1, sizeof *writer);
    writer->path = alloc_text(path);
    exr_context_initializer_t setup = EXR_DEFAULT_CONTEXT_INITIALIZER;
    setup.error_handler_fn = note_failure;
    setup.user_data = writer;
    setup.write_fn = write_at;
    writer->result = draft_open(path, &writer->draft, &writer->why);
    if (good(writer))
        expect(writer, exr_start_write(&writer->file, path, EXR_WRITE_FILE_DIRECTLY, &setup));
    if (good(writer))
        expect(writer, exr_set_longname_support(writer->file, 1));
    return writer;
}

// The display window is one for the whole file: that of the first part.
static void add_sides(struct image_writer *writer, int index, const struct part *part) {
    const struct part *first = &writer->parts[0];
    exr_attr_box2i_t data = {.max = {{{(int)part->width - 1, (int)part->height - 1}}}};
    exr_attr_box2i_t display = {.max = {{{(int)first->width - 1, (int)first->height - 1}}}};
    exr_attr_v2f_t centre = {0};
    expect(writer, exr_initialize_required_attr(writer->file, index, &display, &data, 1, &centre, 1,
                                                EXR_LINEORDER_INCREASING_Y, EXR_COMPRESSION_ZIPS));
    expect(writer, exr_set_zip_compression_level(writer->file, index, ZIP_LEVEL));
}

int image_writer_part(struct image_writer *writer, const char *name, uint32_t width,
                      uint32_t height, const struct image_channel *channels, int channel_count) {
    CHECK(width >= 1 && width <= IMAGE_SIDE_MAX && height >= 1 && height <= IMAGE_SIDE_MAX);
    int index = writer->part_count++;
    writer->parts = alloc_resize(writer->parts, (size_t)writer->part_count, sizeof *writer->parts);
    struct part *part = &writer->parts[index];
    *part = (struct part){.width = width, .height = height, .channel_count = channel_count};
    part->channels = alloc((size_t)channel_count, sizeof *channels);
    memcpy(part->channels, channels, (size_t)channel_count * sizeof *channels);
    int made = index;
    if (good(writer))
        expect(writer, exr_add_part(writer->file, name, EXR_STORAGE_SCANLINE, &made));
    CHECK(!good(writer) || made == index);
    if (good(writer))
        add_sides(writer, index, part);
    for (int i = 0; i < channel_count && good(writer); i++)
        expect(writer,
               exr_add_channel(writer->file, index, channels[i].name,
                               channels[i].type == IMAGE_FLOAT ? EXR_PIXEL_FLOAT : EXR_PIXEL_UINT,
                               EXR_PERCEPTUALLY_LINEAR, 1, 1));
    return index;
}

void image_writer_text(struct image_writer *writer, int part, const char *name, const char *text) {
    if (good(writer))
        expect(writer, exr_attr_set_string(writer->file, part, name, text));
}

void image_writer_number(struct image_writer *writer, int part, const char *name, double number) {
    if (good(writer))
        expect(writer, exr_attr_set_double(writer->file, part, name, number));
}

static int find_channel(const struct part *part, const char *name) {
    for (int i = 0; i < part->channel_count; i++)
        if (!strcmp(part->channels[i].name, name))
            return i;
    CHECK(!"a channel of the file is one of those given");
    return -1;
}

static void begin_part(struct image_writer *writer, const struct part *part,
                       const exr_chunk_info_t *chunk) {
    exr_encode_pipeline_t *pipeline = &writer->pipeline;
    expect(writer, exr_encoding_initialize(writer->file, writer->part, chunk, pipeline));
    if (!good(writer))
        return;
    CHECK(pipeline->channel_count == part->channel_count);
    writer->sources =
        alloc_resize(writer->sources, (size_t)part->channel_count, sizeof *writer->sources);
    for (int i = 0; i < part->channel_count; i++) {
        exr_coding_channel_info_t *channel = &pipeline->channels[i];
        writer->sources[i] = find_channel(part, channel->channel_name);
        channel->user_pixel_stride = sizeof(uint32_t);
        channel->user_line_stride = (int32_t)(part->width * sizeof(uint32_t));
        channel->user_bytes_per_element = sizeof(uint32_t);
        channel->user_data_type = channel->data_type;
    }
}

static void point_at(struct image_writer *writer, const struct part *part, const uint32_t *values) {
    for (int i = 0; i < part->channel_count; i++)
        writer->pipeline.channels[i].encode_from_ptr =
            (const uint8_t *)(values + (size_t)writer->sources[i] * part->width);
}

static void encode_row(struct image_writer *writer, const struct part *part,
                       const uint32_t *values) {
    exr_encode_pipeline_t *pipeline = &writer->pipeline;
    exr_chunk_info_t chunk;
    expect(writer,
           exr_write_scanline_chunk_info(writer->file, writer->part, (int)writer->row, &chunk));
    if (good(writer) && writer->row == 0)
        begin_part(writer, part, &chunk);
    else if (good(writer))
        expect(writer, exr_encoding_update(writer->file, writer->part, &chunk, pipeline));
    if (!good(writer))
        return;
    point_at(writer, part, values);
    if (writer->row == 0)
        expect(writer, exr_encoding_choose_default_routines(writer->file, writer->part, pipeline));
    if (good(writer))
        expect(writer, exr_encoding_run(writer->file, writer->part, pipeline));
}

static void end_part(struct image_writer *writer) {
    if (writer->file)
        exr_encoding_destroy(writer->file, &writer->pipeline);
    writer->pipeline = (exr_encode_pipeline_t)EXR_ENCODE_PIPELINE_INITIALIZER;
    writer->part++;
    writer->row = 0;
}

void image_writer_row(struct image_writer *writer, const uint32_t *values) {
    CHECK(writer->part < writer->part_count);
    const struct part *part = &writer->parts[writer->part];
    if (good(writer) && writer->part == 0 && writer->row == 0)
        expect(writer, exr_write_header(writer->file));
    if (good(writer))
        encode_row(writer, part, values);
    if (++writer->row == part->height)
        end_part(writer);
}

static void release_image(struct image_writer **handle) {
    struct image_writer *writer = *handle;
    for (int i = 0; i < writer->part_count; i++)
        free(writer->parts[i].channels);
    free(writer->parts);
    free(writer->sources);
    free(writer->path);
    free(writer);
    *handle = NULL;
}

void image_writer_abandon(struct image_writer **handle) {
    struct image_writer *writer = *handle;
    if (writer->row)
        end_part(writer);
    if (writer->file)
        exr_finish(&writer->file);
    if (writer->draft.file)
        draft_drop(&writer->draft);
    release_image(handle);
}

enum result image_writer_finish(struct image_writer **handle, struct error *err) {
    struct image_writer *writer = *handle;
    CHECK(writer->part == writer->part_count && writer->part_count > 0);
    if (writer->file)
        expect(writer, exr_finish(&writer->file));
    enum result result = writer->result;
    if (result == RESULT_OK)
        result = draft_keep(&writer->draft, &writer->why);
    else if (writer->draft.file)
        draft_drop(&writer->draft);
    if (result != RESULT_OK)
        fail(err, result, "%s", writer->why.text);
    release_image(handle);
    return result;
}
