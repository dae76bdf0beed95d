#include "api/values.h"

#include "base/number.h"

#include <string.h>

bool value_has_only(struct api_call *call, const json_t *object, const char *const *fields) {
    const char *key;
    json_t *value;
    json_object_foreach((json_t *)object, key, value) {
        bool known = false;
        for (int i = 0; fields[i]; i++)
            known = known || !strcmp(fields[i], key);
        if (!known) {
            call_refuse(call, 400, "wrong_field", NULL, "This request has no field '%.40s'.", key);
            return false;
        }
    }
    return true;
}

bool value_take_body(struct api_call *call, const char *const *fields) {
    call->body = call_parse_body(call);
    return call->body && value_has_only(call, call->body, fields);
}

bool value_is_given(const json_t *object, const char *field) {
    json_t *value = json_object_get(object, field);
    return value && !json_is_null(value);
}

bool value_int(struct api_call *call, const json_t *object, const char *field, int64_t least,
               int64_t most, int64_t *out) {
    json_t *value = json_object_get(object, field);
    *out = json_integer_value(value);
    if (json_is_integer(value) && *out >= least && *out <= most)
        return true;
    call_refuse(call, 400, "wrong_field", field,
                "The field '%s' is not a whole number from %lld to %lld.", field, (long long)least,
                (long long)most);
    return false;
}

bool value_number(struct api_call *call, const json_t *object, const char *field, double least,
                  double most, double *out) {
    json_t *value = json_object_get(object, field);
    *out = json_number_value(value);
    if (json_is_number(value) && *out >= least && *out <= most)
        return true;
    call_refuse(call, 400, "wrong_field", field, "The field '%s' is not a number from %g to %g.",
                field, least, most);
    return false;
}

static bool take_text(struct api_call *call, const json_t *value, const char *field, size_t size,
                      char *out) {
    const char *text = json_string_value(value);
    size_t length = text ? strlen(text) : 0;
    if (length > 0 && length < size) {
        memcpy(out, text, length + 1);
        return true;
    }
    call_refuse(call, 400, "wrong_field", field, "The field '%s' needs a text of 1 to %zu bytes.",
                field, size - 1);
    return false;
}

bool value_text(struct api_call *call, const json_t *object, const char *field, size_t size,
                char *out) {
    return take_text(call, json_object_get(object, field), field, size, out);
}

bool value_true(struct api_call *call, const json_t *object, const char *field) {
    if (json_is_true(json_object_get(object, field)))
        return true;
    call_refuse(call, 400, "wrong_field", field, "The field '%s' is not true.", field);
    return false;
}

bool value_texts(struct api_call *call, const json_t *object, const char *field, int most,
                 size_t stride, char *out, int *out_count) {
    json_t *list = json_object_get(object, field);
    *out_count = 0;
    if (!value_is_given(object, field))
        return true;
    if (!json_is_array(list) || json_array_size(list) > (size_t)most) {
        call_refuse(call, 400, "wrong_field", field,
                    "The field '%s' is not a list of at most %d texts.", field, most);
        return false;
    }
    for (size_t i = 0; i < json_array_size(list); i++)
        if (!take_text(call, json_array_get(list, i), field, stride, out + i * stride))
            return false;
    *out_count = (int)json_array_size(list);
    return true;
}

bool value_parameter(struct api_call *call, const struct call_query *query, int index, double least,
                     double most, double *out) {
    const char *text = call_parameter(query, index);
    if (!text || number_double(text, least, most, out))
        return true;
    call_refuse(call, 400, "wrong_query", query->names[index],
                "The parameter '%s' is a number from %g to %g.", query->names[index], least, most);
    return false;
}

bool value_in_path(struct api_call *call, const char *text, int64_t *out) {
    if (number_int(text, 1, INT32_MAX, out))
        return true;
    call_refuse(call, 404, "not_found", NULL, "There is nothing at this path.");
    return false;
}
