#include "igtl/served.h"

#include "base/check.h"

#include <stdlib.h>
#include <string.h>

struct served_bytes *served_bytes_create(size_t size) {
    struct served_bytes *bytes = alloc(1, sizeof *bytes + size);
    bytes->users = 1;
    bytes->size = size;
    return bytes;
}

void served_bytes_release(struct served_bytes **bytes) {
    if (*bytes && --(*bytes)->users == 0)
        free(*bytes);
    *bytes = NULL;
}

static void empty(struct served_mesh *mesh) {
    served_bytes_release(&mesh->content);
    for (int i = 0; i < IGTL_NEWEST_VERSION; i++)
        served_bytes_release(&mesh->messages[i]);
}

void served_fini(struct served *s) {
    for (int i = 0; i < IGTL_MESHES_MAX; i++)
        empty(&s->meshes[i]);
}

void served_put_poses(struct served *s, const struct igtl_poses *poses, int64_t now_ns) {
    s->sets[++s->set_count % SERVED_SETS] = (struct served_set){now_ns, *poses};
}

void served_put_string(struct served *s, const struct served_string *string) {
    s->strings[++s->string_count % IGTL_STRINGS_MAX] = *string;
}

void served_put_state(struct served *s, const struct igtl_state *state) {
    bool same = s->state_count && s->state.code == state->code &&
                s->state.subcode == state->subcode && !strcmp(s->state.name, state->name) &&
                !strcmp(s->state.text, state->text);
    s->state = *state;
    s->state_count += !same;
}

void served_put_mesh(struct served *s, int place, const char *name, int64_t utc_ns,
                     struct served_bytes *content) {
    struct served_mesh *mesh = &s->meshes[place];
    empty(mesh);
    memcpy(mesh->name, name, sizeof mesh->name);
    mesh->count++;
    mesh->utc_ns = utc_ns;
    mesh->content = content;
}

const struct served_set *served_get_set(const struct served *s, uint64_t number) {
    CHECK(number && number <= s->set_count && s->set_count - number < SERVED_SETS);
    return &s->sets[number % SERVED_SETS];
}

const struct served_string *served_get_string(const struct served *s, uint64_t number) {
    CHECK(number && number <= s->string_count && s->string_count - number < IGTL_STRINGS_MAX);
    return &s->strings[number % IGTL_STRINGS_MAX];
}

struct served_bytes *served_use_mesh(struct served_mesh *mesh, int version) {
    struct served_bytes **message = &mesh->messages[version - 1];
    if (!*message) {
        struct igtl_head head = {.version = version,
                                 .type = "POLYDATA",
                                 .device = mesh->name,
                                 .stamp = igtl_stamp(mesh->utc_ns)};
        *message = served_bytes_create(igtl_message_size(&head, mesh->content->size));
        memcpy((*message)->bytes + igtl_message_content(version), mesh->content->bytes,
               mesh->content->size);
        igtl_message_finish(&head, mesh->content->size, (*message)->bytes);
    }
    (*message)->users++;
    return *message;
}
