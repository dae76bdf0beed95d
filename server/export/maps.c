#include "export/maps.h"

#include "base/check.h"
#include "export/atlas.h"
#include "export/landings.h"

#include <stdlib.h>
#include <string.h>

struct maps {
    const struct scene *scene;
    int width[TISSUES_MAX];     // as in struct touch_change; 0: the tissue never gives way
    double *start[TISSUES_MAX]; // so many values for each of its vertices
    int count;
    struct landing *landings;
};

static const struct case_group *group_of(const struct maps *maps, int tissue) {
    return &scene_case(maps->scene)->groups[scene_tissue_group(maps->scene, tissue)];
}

// ---- which there are ----------------------------------------------------------------------------

static void map_start(void *context, const struct operation *operation) {
    struct maps *maps = context;
    for (int i = 0; i < scene_tissue_count(maps->scene); i++) {
        uint32_t count = group_of(maps, i)->mesh.vertex_count;
        maps->width[i] = operation_touch_width(operation, i);
        maps->start[i] = alloc((size_t)maps->width[i] * count, sizeof(double));
        for (uint32_t v = 0; maps->width[i] && v < count; v++)
            operation_touch(operation, i, v, maps->start[i] + (size_t)maps->width[i] * v);
    }
}

static void keep(void *context, struct landing *landing, const struct operation *operation) {
    struct maps *maps = context;
    if (!operation_touch_width(operation, landing->result->tissue))
        return;
    maps->landings = alloc_resize(maps->landings, (size_t)maps->count + 1, sizeof *maps->landings);
    maps->landings[maps->count++] = *landing;
    landing->result = NULL;
}

enum result maps_create(struct walk *walk, struct maps **out_maps, struct error *err) {
    struct maps *maps = alloc(1, sizeof *maps);
    struct landing_watcher watcher = {.context = maps, .start = map_start, .landed = keep};
    maps->scene = walk->request->scene;
    enum result result = landings_run(walk, &watcher, err);
    if (result != RESULT_OK)
        maps_destroy(&maps);
    *out_maps = maps;
    return result;
}

void maps_destroy(struct maps **handle) {
    struct maps *maps = *handle;
    if (!maps)
        return;
    for (int i = 0; i < maps->count; i++)
        job_result_destroy(&maps->landings[i].result);
    for (int i = 0; i < TISSUES_MAX; i++)
        free(maps->start[i]);
    free(maps->landings);
    free(maps);
    *handle = NULL;
}

// ---- what they show -----------------------------------------------------------------------------

// A picture of a group: what it shows of each vertex.
struct group_map {
    const struct case_group *group;
    const double *touch; // values of a cut; NULL: the group as it is
    double (*value)(const struct group_map *view, int quantity, uint32_t vertex);
    int quantities;
    int exact;       // the first so many of them are given bit for bit too
    bool has_vertex; // and the vertex's number last
    const struct image_channel *channels;
    int channel_count;
};

static double component(const float *vectors, uint32_t vertex, int axis) {
    return vectors ? (double)vectors[3 * (size_t)vertex + (size_t)axis] : 0;
}

static double surface_value(const struct group_map *view, int quantity, uint32_t vertex) {
    const struct case_group *group = view->group;
    const float *const vectors[] = {group->mesh.positions, group->warp, group->maxcut};
    return component(vectors[quantity / 3], vertex, quantity % 3);
}

// The blend, and S'' − S
static double blend_value(const struct group_map *view, int quantity, uint32_t vertex) {
    double blend = view->touch[vertex];
    if (quantity == 0)
        return blend;
    return component(view->group->warp, vertex, quantity - 1) +
           blend * component(view->group->maxcut, vertex, quantity - 1);
}

// S'' − S' and S'' − S
static double offset_value(const struct group_map *view, int quantity, uint32_t vertex) {
    double offset = view->touch[3 * (size_t)vertex + (size_t)(quantity % 3)];
    return quantity < 3 ? offset : component(view->group->warp, vertex, quantity - 3) + offset;
}

static const struct image_channel surface_channels[] = {
    {"position.x", IMAGE_FLOAT}, {"position.y", IMAGE_FLOAT}, {"position.z", IMAGE_FLOAT},
    {"warp.x", IMAGE_FLOAT},     {"warp.y", IMAGE_FLOAT},     {"warp.z", IMAGE_FLOAT},
    {"maxcut.x", IMAGE_FLOAT},   {"maxcut.y", IMAGE_FLOAT},   {"maxcut.z", IMAGE_FLOAT},
    {"vertex", IMAGE_UINT}};

static const struct image_channel offset_channels[] = {
    {"offset.x", IMAGE_FLOAT},       {"offset.x.low", IMAGE_UINT},
    {"offset.x.high", IMAGE_UINT},   {"offset.y", IMAGE_FLOAT},
    {"offset.y.low", IMAGE_UINT},    {"offset.y.high", IMAGE_UINT},
    {"offset.z", IMAGE_FLOAT},       {"offset.z.low", IMAGE_UINT},
    {"offset.z.high", IMAGE_UINT},   {"displacement.x", IMAGE_FLOAT},
    {"displacement.y", IMAGE_FLOAT}, {"displacement.z", IMAGE_FLOAT}};

static const struct image_channel blend_channels[] = {
    {"blend", IMAGE_FLOAT},          {"blend.low", IMAGE_UINT},
    {"blend.high", IMAGE_UINT},      {"displacement.x", IMAGE_FLOAT},
    {"displacement.y", IMAGE_FLOAT}, {"displacement.z", IMAGE_FLOAT}};

#define COUNT(array) ((int)(sizeof(array) / sizeof *(array)))

static const struct group_map surface_view = {.value = surface_value,
                                              .quantities = 9,
                                              .has_vertex = true,
                                              .channels = surface_channels,
                                              .channel_count = COUNT(surface_channels)};
static const struct group_map blend_view = {.value = blend_value,
                                            .quantities = 4,
                                            .exact = 1,
                                            .channels = blend_channels,
                                            .channel_count = COUNT(blend_channels)};
static const struct group_map offset_view = {.value = offset_value,
                                             .quantities = 6,
                                             .exact = 3,
                                             .channels = offset_channels,
                                             .channel_count = COUNT(offset_channels)};

static double texel_value(const struct group_map *view, int quantity, const uint32_t corners[3],
                          int corner) {
    double v[3];
    if (corner != ATLAS_FOURTH)
        return view->value(view, quantity, corners[corner]);
    for (int i = 0; i < 3; i++)
        v[i] = view->value(view, quantity, corners[i]);
    return v[1] + v[2] - v[0];
}

static void fill_texel(const struct group_map *view, const uint32_t corners[3], int corner,
                       uint32_t *values, uint32_t width) {
    for (int i = 0; i < view->quantities; i++) {
        double value = texel_value(view, i, corners, corner);
        *values = image_float((float)value);
        values += width;
        if (i >= view->exact)
            continue;
        image_split(image_bits(value), values, values + width);
        values += 2 * (size_t)width;
    }
    if (view->has_vertex)
        *values = corner == ATLAS_FOURTH ? MESH_NONE : corners[corner];
}

static void write_view(const struct group_map *view, struct image_writer *writer) {
    const struct mesh *mesh = &view->group->mesh;
    struct atlas atlas = atlas_of(mesh->triangle_count);
    size_t count = (size_t)view->channel_count * atlas.width;
    uint32_t *values = alloc(count, sizeof *values);
    for (uint32_t y = 0; y < atlas.height; y++) {
        memset(values, 0, count * sizeof *values);
        for (uint32_t x = 0; x < atlas.width; x++) {
            int corner;
            uint32_t triangle = atlas_triangle(&atlas, x, y, &corner);
            if (triangle != UINT32_MAX)
                fill_texel(view, mesh->triangles + 3 * (size_t)triangle, corner, values + x,
                           atlas.width);
            else if (view->has_vertex)
                values[(size_t)(view->channel_count - 1) * atlas.width + x] = MESH_NONE;
        }
        image_writer_row(writer, values);
    }
    free(values);
}

// ---- all of them --------------------------------------------------------------------------------

static bool tissue_has_maps(const struct maps *maps, int tissue) {
    for (int i = 0; i < maps->count; i++)
        if (maps->landings[i].wanted && maps->landings[i].result->tissue == tissue)
            return true;
    return false;
}

static int declare_view(const struct group_map *view, const char *name,
                        struct image_writer *writer) {
    struct atlas atlas = atlas_of(view->group->mesh.triangle_count);
    return image_writer_part(writer, name, atlas.width, atlas.height, view->channels,
                             view->channel_count);
}

static struct group_map cut_view(const struct maps *maps, int tissue) {
    struct group_map view = maps->width[tissue] == 1 ? blend_view : offset_view;
    view.group = group_of(maps, tissue);
    return view;
}

static void declare_cut(const struct maps *maps, const struct landing *landing,
                        struct image_writer *writer) {
    struct group_map view = cut_view(maps, landing->result->tissue);
    char name[CASE_NAME_MAX + 32];
    snprintf(name, sizeof name, "%s.job_%llu", view.group->name,
             (unsigned long long)landing->result->job);
    int part = declare_view(&view, name, writer);
    image_writer_text(writer, part, "arthron:group", view.group->name);
    image_writer_text(writer, part, "arthron:job_kind", job_kind_name(landing->kind));
    image_writer_number(writer, part, "arthron:job", (double)landing->result->job);
    image_writer_number(writer, part, "arthron:landed_step", (double)landing->step);
    image_writer_number(writer, part, "arthron:landed_s", landing->seconds);
    image_writer_number(writer, part, "arthron:as_recorded", landing->as_recorded);
}

void maps_declare(const struct maps *maps, struct image_writer *writer) {
    for (int tissue = 0; tissue < scene_tissue_count(maps->scene); tissue++) {
        struct group_map view = surface_view;
        view.group = group_of(maps, tissue);
        if (tissue_has_maps(maps, tissue))
            declare_view(&view, view.group->name, writer);
    }
    for (int i = 0; i < maps->count; i++)
        if (maps->landings[i].wanted)
            declare_cut(maps, &maps->landings[i], writer);
}

static void apply(const struct touch_change *change, double *touch) {
    size_t width = (size_t)change->width;
    for (uint32_t i = 0; i < change->count; i++)
        memcpy(touch + width * change->vertices[i], change->values + width * i,
               width * sizeof *touch);
}

static void write_cuts(const struct maps *maps, double *const touch[TISSUES_MAX],
                       struct image_writer *writer) {
    for (int i = 0; i < maps->count; i++) {
        const struct job_result *result = maps->landings[i].result;
        struct group_map view = cut_view(maps, result->tissue);
        view.touch = touch[result->tissue];
        apply(&result->touch, touch[result->tissue]);
        if (maps->landings[i].wanted)
            write_view(&view, writer);
    }
}

void maps_write(const struct maps *maps, struct image_writer *writer) {
    double *touch[TISSUES_MAX] = {0};
    int count = scene_tissue_count(maps->scene);
    for (int tissue = 0; tissue < count; tissue++) {
        struct group_map view = surface_view;
        view.group = group_of(maps, tissue);
        size_t values = (size_t)maps->width[tissue] * view.group->mesh.vertex_count;
        touch[tissue] = alloc(values, sizeof(double));
        if (maps->start[tissue])
            memcpy(touch[tissue], maps->start[tissue], values * sizeof(double));
        if (tissue_has_maps(maps, tissue))
            write_view(&view, writer);
    }
    write_cuts(maps, touch, writer);
    for (int tissue = 0; tissue < count; tissue++)
        free(touch[tissue]);
}
