#include "replay/parts.h"

#include "base/check.h"

#include <openexr.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static exr_result_t read_layout(exr_context_t file, int index, struct exr_part *part) {
    exr_attr_box2i_t window;
    const exr_attr_chlist_t *channels;
    const char *name;
    exr_result_t code = exr_get_data_window(file, index, &window);
    if (code == EXR_ERR_SUCCESS)
        code = exr_get_channels(file, index, &channels);
    if (code != EXR_ERR_SUCCESS)
        return code;
    part->width = (uint32_t)(window.max.x + 1);
    part->height = (uint32_t)(window.max.y + 1);
    part->channel_count = channels->num_channels;
    part->channels = alloc((size_t)part->channel_count, sizeof *part->channels);
    for (int i = 0; i < part->channel_count; i++) {
        struct exr_channel *channel = &part->channels[i];
        snprintf(channel->name, sizeof channel->name, "%s", channels->entries[i].name.str);
        channel->is_float = channels->entries[i].pixel_type == EXR_PIXEL_FLOAT;
        channel->values = alloc((size_t)part->width * part->height, sizeof(uint32_t));
    }
    if (exr_get_name(file, index, &name) == EXR_ERR_SUCCESS && name)
        snprintf(part->name, sizeof part->name, "%s", name);
    return EXR_ERR_SUCCESS;
}

static void point_at(struct exr_part *part, exr_decode_pipeline_t *pipeline, uint32_t y) {
    for (int i = 0; i < pipeline->channel_count; i++) {
        exr_coding_channel_info_t *channel = &pipeline->channels[i];
        channel->decode_to_ptr = (uint8_t *)(part->channels[i].values + (size_t)y * part->width);
        channel->user_pixel_stride = sizeof(uint32_t);
        channel->user_line_stride = (int32_t)(part->width * sizeof(uint32_t));
        channel->user_bytes_per_element = sizeof(uint32_t);
        channel->user_data_type = channel->data_type;
    }
}

static exr_result_t read_rows(exr_context_t file, int index, struct exr_part *part) {
    exr_decode_pipeline_t pipeline = EXR_DECODE_PIPELINE_INITIALIZER;
    exr_result_t code = EXR_ERR_SUCCESS;
    for (uint32_t y = 0; y < part->height && code == EXR_ERR_SUCCESS; y++) {
        exr_chunk_info_t chunk;
        code = exr_read_scanline_chunk_info(file, index, (int)y, &chunk);
        if (code == EXR_ERR_SUCCESS)
            code = y ? exr_decoding_update(file, index, &chunk, &pipeline)
                     : exr_decoding_initialize(file, index, &chunk, &pipeline);
        if (code != EXR_ERR_SUCCESS)
            break;
        point_at(part, &pipeline, y);
        if (y == 0)
            code = exr_decoding_choose_default_routines(file, index, &pipeline);
        if (code == EXR_ERR_SUCCESS)
            code = exr_decoding_run(file, index, &pipeline);
    }
    exr_decoding_destroy(file, &pipeline);
    return code;
}

enum result exr_parts_read(const char *path, struct exr_parts *parts, struct error *err) {
    exr_context_t file;
    exr_context_initializer_t setup = EXR_DEFAULT_CONTEXT_INITIALIZER;
    *parts = (struct exr_parts){0};
    exr_result_t code = exr_start_read(&file, path, &setup);
    if (code != EXR_ERR_SUCCESS)
        return fail(err, RESULT_IO, "%s: %s", path, exr_get_default_error_message(code));
    code = exr_get_count(file, &parts->count);
    parts->parts = alloc((size_t)parts->count, sizeof *parts->parts);
    for (int i = 0; i < parts->count && code == EXR_ERR_SUCCESS; i++) {
        code = read_layout(file, i, &parts->parts[i]);
        if (code == EXR_ERR_SUCCESS)
            code = read_rows(file, i, &parts->parts[i]);
    }
    exr_finish(&file);
    if (code == EXR_ERR_SUCCESS)
        return RESULT_OK;
    exr_parts_fini(parts);
    return fail(err, RESULT_FORMAT, "%s: %s", path, exr_get_default_error_message(code));
}

void exr_parts_fini(struct exr_parts *parts) {
    for (int i = 0; i < parts->count; i++) {
        for (int k = 0; k < parts->parts[i].channel_count; k++)
            free(parts->parts[i].channels[k].values);
        free(parts->parts[i].channels);
    }
    free(parts->parts);
    *parts = (struct exr_parts){0};
}

const struct exr_part *exr_part(const struct exr_parts *parts, const char *name) {
    for (int i = 0; i < parts->count; i++)
        if (!strcmp(parts->parts[i].name, name))
            return &parts->parts[i];
    return NULL;
}

const uint32_t *exr_values(const struct exr_part *part, const char *name, const char *ending) {
    char whole[256];
    snprintf(whole, sizeof whole, "%s%s", name, ending);
    for (int i = 0; i < part->channel_count; i++)
        if (!strcmp(part->channels[i].name, whole))
            return part->channels[i].values;
    return NULL;
}
