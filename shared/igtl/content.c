#include "igtl/content.h"

#include "igtl/big_endian.h"

#include <openigtlink/igtl_polydata.h>
#include <openigtlink/igtl_position.h>
#include <openigtlink/igtl_qtdata.h>
#include <openigtlink/igtl_string.h>
#include <openigtlink/igtl_tdata.h>
#include <openigtlink/igtl_transform.h>
#include <string.h>

_Static_assert(IGTL_TDATA_SIZE == sizeof(igtl_tdata_element) &&
                   IGTL_QTDATA_SIZE == sizeof(igtl_qtdata_element) &&
                   IGTL_START_SIZE == sizeof(igtl_stt_tdata) &&
                   IGTL_POSITION_SIZE == sizeof(igtl_position),
               "the library's layouts");

enum { STATUS_NAME_SIZE = 20, CAPABILITY_TYPE_SIZE = 12 };

static const uint16_t utf_8 = 106, us_ascii = 3; // of IANA's character sets

static void copy_name(char *out, const char *name, size_t size) {
    memset(out, 0, size);
    memcpy(out, name, strnlen(name, size));
}

// ---- poses --------------------------------------------------------------------------------------

// The columns: three axes, then the translation.
static void to_matrix(pose p, float out[12]) {
    mat3 r = quat_to_mat3(p.rotation);
    for (int column = 0; column < 3; column++)
        for (int row = 0; row < 3; row++)
            out[3 * column + row] = (float)r.m[row][column];
    out[9] = (float)p.translation.x;
    out[10] = (float)p.translation.y;
    out[11] = (float)p.translation.z;
}

static void to_numbers(pose p, float out[7]) {
    const float values[7] = {(float)p.translation.x, (float)p.translation.y, (float)p.translation.z,
                             (float)p.rotation.x,    (float)p.rotation.y,    (float)p.rotation.z,
                             (float)p.rotation.w};
    memcpy(out, values, sizeof values);
}

size_t igtl_write_transform(pose p, uint8_t out[IGTL_TRANSFORM_SIZE]) {
    float matrix[12];
    to_matrix(p, matrix);
    igtl_transform_convert_byte_order(matrix);
    memcpy(out, matrix, sizeof matrix);
    return sizeof matrix;
}

size_t igtl_write_position(pose p, uint8_t out[IGTL_POSITION_SIZE]) {
    igtl_position position;
    float numbers[7];
    to_numbers(p, numbers);
    memcpy(&position, numbers, sizeof position);
    igtl_position_convert_byte_order(&position);
    memcpy(out, &position, sizeof position);
    return sizeof position;
}

size_t igtl_write_tdata(const char *name, pose p, uint8_t out[IGTL_TDATA_SIZE]) {
    igtl_tdata_element element = {.type = IGTL_TDATA_TYPE_6D};
    float matrix[12];
    to_matrix(p, matrix);
    copy_name(element.name, name, sizeof element.name);
    memcpy(element.transform, matrix, sizeof matrix);
    igtl_tdata_convert_byte_order(&element, 1);
    memcpy(out, &element, sizeof element);
    return sizeof element;
}

size_t igtl_write_qtdata(const char *name, pose p, uint8_t out[IGTL_QTDATA_SIZE]) {
    igtl_qtdata_element element = {.type = IGTL_QTDATA_TYPE_6D};
    float numbers[7];
    to_numbers(p, numbers);
    copy_name(element.name, name, sizeof element.name);
    memcpy(element.position, numbers, 3 * sizeof *numbers);
    memcpy(element.quaternion, numbers + 3, 4 * sizeof *numbers);
    igtl_qtdata_convert_byte_order(&element, 1);
    memcpy(out, &element, sizeof element);
    return sizeof element;
}

size_t igtl_write_start(int interval_ms, const char *coordinates, uint8_t out[IGTL_START_SIZE]) {
    igtl_stt_tdata body = {.resolution = interval_ms};
    copy_name(body.coord_name, coordinates, sizeof body.coord_name);
    igtl_stt_tdata_convert_byte_order(&body);
    memcpy(out, &body, sizeof body);
    return sizeof body;
}

// ---- texts --------------------------------------------------------------------------------------

// Where a text is cut, so that no character of UTF-8 is.
static size_t text_length(const char *text) {
    size_t length = strnlen(text, IGTL_TEXT_SIZE);
    if (length < IGTL_TEXT_SIZE)
        return length;
    for (length = IGTL_TEXT_SIZE - 1; length && ((uint8_t)text[length] & 0xc0) == 0x80;)
        length--;
    return length;
}

// The text ends with a 0, which belongs to the content.
size_t igtl_write_status(int code, int64_t subcode, const char *name, const char *text,
                         uint8_t out[IGTL_STATUS_SIZE_MAX]) {
    size_t length = text_length(text);
    uint8_t *end = big_endian_put(big_endian_put(out, (uint64_t)code, 2), (uint64_t)subcode, 8);
    copy_name((char *)end, name, STATUS_NAME_SIZE);
    end += STATUS_NAME_SIZE;
    memcpy(end, text, length);
    end[length] = 0;
    return (size_t)(end - out) + length + 1;
}

static bool is_ascii(const char *text, size_t length) {
    for (size_t i = 0; i < length; i++)
        if ((uint8_t)text[i] > 0x7f)
            return false;
    return true;
}

size_t igtl_write_string(const char *text, uint8_t out[IGTL_STRING_SIZE_MAX]) {
    size_t length = text_length(text);
    igtl_string_header header = {is_ascii(text, length) ? us_ascii : utf_8, (igtl_uint16)length};
    igtl_string_convert_byte_order(&header);
    memcpy(out, &header, sizeof header);
    memcpy(out + sizeof header, text, length);
    return sizeof header + length;
}

size_t igtl_write_capability(const char *const *types, int count, uint8_t *out) {
    for (int i = 0; i < count; i++)
        copy_name((char *)out + i * CAPABILITY_TYPE_SIZE, types[i], CAPABILITY_TYPE_SIZE);
    return (size_t)count * CAPABILITY_TYPE_SIZE;
}

// ---- meshes -------------------------------------------------------------------------------------

enum { POINT_SIZE = 12, POLYGON_SIZE = 16 }; // three floats; the number of corners and three

size_t igtl_polydata_size(int vertex_count, int triangle_count) {
    return sizeof(igtl_polydata_header) + (size_t)vertex_count * POINT_SIZE +
           (size_t)triangle_count * POLYGON_SIZE;
}

size_t igtl_write_polydata(const float *positions, int vertex_count, const uint32_t *triangles,
                           int triangle_count, uint8_t *out) {
    enum { SIZES_BEFORE_POLYGONS = 4, SIZES_BEHIND = 3 };
    uint8_t *end = big_endian_put(out, (uint64_t)vertex_count, 4);
    end = memset(end, 0, SIZES_BEFORE_POLYGONS * 4); // vertices and lines: counts and sizes
    end = big_endian_put(end + SIZES_BEFORE_POLYGONS * 4, (uint64_t)triangle_count, 4);
    end = big_endian_put(end, (uint64_t)triangle_count * POLYGON_SIZE, 4);
    end = memset(end, 0, SIZES_BEHIND * 4); // strips and attributes
    end += SIZES_BEHIND * 4;
    for (size_t i = 0; i < 3 * (size_t)vertex_count; i++) {
        uint32_t bits;
        memcpy(&bits, &positions[i], sizeof bits);
        end = big_endian_put(end, bits, 4);
    }
    for (size_t t = 0; t < (size_t)triangle_count; t++) {
        end = big_endian_put(end, 3, 4);
        for (int corner = 0; corner < 3; corner++)
            end = big_endian_put(end, triangles[3 * t + (size_t)corner], 4);
    }
    return (size_t)(end - out);
}
