// The values of a body that has more than texts: numbers, lists, objects. Each function takes the
// object, the name of a field of it and its bounds. False: the request has been refused, with the
// field's name.
#pragma once

#include "api/call.h"

// Reads the body: an object with no fields but these (NULL ends them).
bool value_take_body(struct api_call *call, const char *const *fields);
// Whether an object in the body has no fields but these.
bool value_has_only(struct api_call *call, const json_t *object, const char *const *fields);

bool value_int(struct api_call *call, const json_t *object, const char *field, int64_t least,
               int64_t most, int64_t *out);
bool value_number(struct api_call *call, const json_t *object, const char *field, double least,
                  double most, double *out);
bool value_text(struct api_call *call, const json_t *object, const char *field, size_t size,
                char *out);
bool value_true(struct api_call *call, const json_t *object, const char *field);

// Whether the field is there and not null.
bool value_is_given(const json_t *object, const char *field);

// A list of texts, one after the other at `stride` bytes. Left out: an empty list.
bool value_texts(struct api_call *call, const json_t *object, const char *field, int most,
                 size_t stride, char *out, int *out_count);

// A parameter of the query as a number; *out is unchanged where it is not given.
bool value_parameter(struct api_call *call, const struct call_query *query, int index, double least,
                     double most, double *out);

// The number in a part of the path, from 1; 404 else.
bool value_in_path(struct api_call *call, const char *text, int64_t *out);
