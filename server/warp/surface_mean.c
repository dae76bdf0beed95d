#include "warp/surface_mean.h"

#include "base/check.h"

#include <stdlib.h>

// A piece of surface is taken as a whole where it is smaller than this share of its distance and
// what that leaves out is less than this share of the differences of u.
#define FAR_RATIO 0.5
#define FAR_ERROR 1e-4

#define SQUARE_MAX 1e300 // beyond, r² overflows

// The displacement over a piece of surface.
struct displacement_moments {
    vec3 mean;  // ∫ u dA / A
    mat3 slope; // ∫ u sᵀ dA, s from the piece's centre
};

struct surface_mean {
    const struct surface_tree *tree;
    const float *displacement;
    struct displacement_moments *moments; // of each node
    bool *is_stale;                       // with all above it
};

// ---- moments ------------------------------------------------------------------------------------

// A triangle and what moves its corners.
struct patch {
    vec3 x[3], u[3];
};

static struct patch patch_of(const struct surface_mean *mean, uint32_t place) {
    const struct mesh *mesh = mean->tree->mesh;
    const uint32_t *vertices = mesh->triangles + 3 * (size_t)mean->tree->order[place];
    struct patch patch;
    for (int i = 0; i < 3; i++) {
        const float *u = mean->displacement + 3 * (size_t)vertices[i];
        patch.x[i] = mesh_vertex(mesh, vertices[i]);
        patch.u[i] = (vec3){(double)u[0], (double)u[1], (double)u[2]};
    }
    return patch;
}

// Over a triangle ∫ u sᵀ dA = A/12 Σ u sᵀ, summed over its corners.
static struct displacement_moments patch_moments(const struct patch *patch,
                                                 const struct surface_piece *piece) {
    const vec3 *u = patch->u;
    struct displacement_moments m = {vec3_scale(1.0 / 3, vec3_add(vec3_add(u[0], u[1]), u[2])),
                                     {{{0}}}};
    for (int i = 0; i < 3; i++)
        surface_add_outer(&m.slope, piece->area / 12, u[i], vec3_sub(patch->x[i], piece->centre));
    return m;
}

static void gather(struct surface_mean *mean, uint32_t index) {
    const struct surface_tree *tree = mean->tree;
    const struct surface_piece *whole = &tree->nodes[index].piece;
    struct surface_piece pieces[SURFACE_LEAF_MAX];
    int count = surface_pieces(tree, index, pieces);
    struct displacement_moments sum = {0};
    for (int i = 0; i < count; i++) {
        struct displacement_moments part;
        if (surface_is_leaf(tree, index)) {
            struct patch patch = patch_of(mean, tree->nodes[index].first + (uint32_t)i);
            part = patch_moments(&patch, &pieces[i]);
        } else {
            part = mean->moments[i ? tree->nodes[index + 1].end : index + 1];
        }
        vec3 off = vec3_sub(pieces[i].centre, whole->centre);
        double share = whole->area > 0 ? pieces[i].area / whole->area : 0;
        sum.mean = vec3_add_scaled(sum.mean, share, part.mean);
        sum.slope = mat3_add_scaled(sum.slope, 1, part.slope);
        surface_add_outer(&sum.slope, pieces[i].area, part.mean, off);
    }
    mean->moments[index] = sum;
}

static void refresh(struct surface_mean *mean, uint32_t index) {
    if (!mean->is_stale[index])
        return;
    mean->is_stale[index] = false;
    if (!surface_is_leaf(mean->tree, index)) {
        refresh(mean, index + 1);
        refresh(mean, mean->tree->nodes[index + 1].end);
    }
    gather(mean, index);
}

struct surface_mean *surface_mean_create(const struct surface_tree *tree,
                                         const float *displacement) {
    struct surface_mean *mean = alloc(1, sizeof *mean);
    mean->tree = tree;
    mean->displacement = displacement;
    mean->moments = alloc(tree->node_count, sizeof *mean->moments);
    mean->is_stale = alloc(tree->node_count, sizeof *mean->is_stale);
    for (uint32_t i = 0; i < tree->node_count; i++)
        mean->is_stale[i] = true;
    refresh(mean, 0);
    return mean;
}

void surface_mean_destroy(struct surface_mean **mean) {
    if (!*mean)
        return;
    free((*mean)->moments);
    free((*mean)->is_stale);
    free(*mean);
    *mean = NULL;
}

void surface_mean_update(struct surface_mean *mean, const uint32_t *vertices, uint32_t count) {
    const struct surface_tree *tree = mean->tree;
    for (uint32_t i = 0; i < count; i++) {
        CHECK(vertices[i] < tree->mesh->vertex_count);
        for (uint32_t k = tree->first_of[vertices[i]]; k < tree->first_of[vertices[i] + 1]; k++)
            for (uint32_t n = tree->leaf_of[k]; !mean->is_stale[n]; n = tree->parents[n])
                mean->is_stale[n] = true;
    }
    refresh(mean, 0);
}

// ---- the walk -----------------------------------------------------------------------------------

// Integrals over what has been passed, and their derivatives by the point. Weights are (d/r)⁵ with
// d the distance from the surface: they neither overflow nor vanish.
struct sums {
    vec3 p;
    double square; // d²
    double extent; // of the surface, squared
    double weight;
    vec3 weight_slope;
    vec3 field, place; // of u, and of x − p
    mat3 field_slope, place_slope;
};

// A piece as p sees it.
struct sight {
    vec3 r;         // from its centre to p
    double inverse; // 1/r²
};

static struct sight look(const struct sums *s, const struct surface_piece *piece) {
    vec3 r = vec3_sub(s->p, piece->centre);
    return (struct sight){r, 1 / vec3_dot(r, r)};
}

// The weight of a piece is known up to its second moments, so that it is wrong by a share of about
// (radius/r)³; it is area · (d/r)⁵ of about d² in all; and u differs there from u near p the more,
// up to the extent of the surface, the farther away it is: together area/d² · d⁵ radius³ / r⁷ /
// extent.
static bool is_far(const struct sums *s, const struct surface_piece *piece,
                   const struct sight *sight) {
    double size = piece->radius * piece->radius * sight->inverse;
    double area = piece->area * sight->inverse, near = s->square * sight->inverse;
    double error = size * size * size * area * area * near * near * near;
    return size < FAR_RATIO * FAR_RATIO &&
           error < FAR_ERROR * FAR_ERROR * s->extent * sight->inverse;
}

static vec3 apply(const mat3 *a, vec3 v) {
    return (vec3){a->m[0][0] * v.x + a->m[0][1] * v.y + a->m[0][2] * v.z,
                  a->m[1][0] * v.x + a->m[1][1] * v.y + a->m[1][2] * v.z,
                  a->m[2][0] * v.x + a->m[2][1] * v.y + a->m[2][2] * v.z};
}

static void add_matrix(mat3 *sum, double scale, const mat3 *a) {
    for (int i = 0; i < 3; i++)
        for (int k = 0; k < 3; k++)
            sum->m[i][k] += scale * a->m[i][k];
}

// |r − s|⁻⁵ to second order in s. With f = (d/r)⁵, g = 5 f/r², h = 7 g/r², k = 9 h/r², of which
// each is minus the gradient of the one before over r:
//     w = ∫ (d/|r − s|)⁵ dA = A f + ½ (h rᵀSr − g tr S),   S = ∫ s sᵀ dA
//     ∫ u … dA = ū w + g K r,  K = ∫ u sᵀ dA;   ∫ (x − p) … dA = −r w + g S r
static void add(struct sums *sums, const struct surface_piece *piece,
                const struct displacement_moments *m, const struct sight *sight) {
    vec3 r = sight->r, Sr = apply(&piece->spread, r), Kr = apply(&m->slope, r);
    double ratio = sums->square * sight->inverse;
    double f = ratio * ratio * sqrt(ratio), g = 5 * sight->inverse * f;
    double h = 7 * sight->inverse * g, k = 9 * sight->inverse * h;
    double rSr = vec3_dot(r, Sr);
    double trace = piece->spread.m[0][0] + piece->spread.m[1][1] + piece->spread.m[2][2];
    double w = piece->area * f + 0.5 * (h * rSr - g * trace);
    double along = 0.5 * (h * trace - k * rSr) - g * piece->area;
    vec3 slope = vec3_add_scaled(vec3_scale(along, r), h, Sr);
    sums->weight += w;
    sums->weight_slope = vec3_add(sums->weight_slope, slope);
    sums->field = vec3_add_scaled(vec3_add_scaled(sums->field, w, m->mean), g, Kr);
    sums->place = vec3_add_scaled(vec3_add_scaled(sums->place, -w, r), g, Sr);
    surface_add_outer(&sums->field_slope, 1, m->mean, slope);
    surface_add_outer(&sums->field_slope, -h, Kr, r);
    add_matrix(&sums->field_slope, g, &m->slope);
    surface_add_outer(&sums->place_slope, -1, r, slope);
    surface_add_outer(&sums->place_slope, -h, Sr, r);
    add_matrix(&sums->place_slope, g, &piece->spread);
    for (int i = 0; i < 3; i++)
        sums->place_slope.m[i][i] -= w;
}

static int longest_side(const struct patch *patch) {
    double squares[3];
    for (int i = 0; i < 3; i++) {
        vec3 side = vec3_sub(patch->x[(i + 1) % 3], patch->x[i]);
        squares[i] = vec3_dot(side, side);
    }
    int longest = squares[1] > squares[0];
    return squares[2] > squares[longest] ? 2 : longest;
}

// A near triangle is halved across its longest side until its parts are far.
static void add_patch(struct sums *sums, const struct patch *patch) {
    struct surface_piece piece = surface_triangle(patch->x);
    struct sight sight = look(sums, &piece);
    if (!(piece.area > 0))
        return;
    if (is_far(sums, &piece, &sight)) {
        struct displacement_moments m = patch_moments(patch, &piece);
        add(sums, &piece, &m, &sight);
        return;
    }
    int from = longest_side(patch), to = (from + 1) % 3;
    struct patch one = *patch, two = *patch;
    one.x[to] = two.x[from] = vec3_lerp(patch->x[from], patch->x[to], 0.5);
    one.u[to] = two.u[from] = vec3_lerp(patch->u[from], patch->u[to], 0.5);
    add_patch(sums, &one);
    add_patch(sums, &two);
}

static void walk(const struct surface_mean *mean, struct sums *sums) {
    const struct surface_tree *tree = mean->tree;
    for (uint32_t i = 0; i < tree->node_count;) {
        const struct surface_node *node = &tree->nodes[i];
        struct sight sight = look(sums, &node->piece);
        bool far = is_far(sums, &node->piece, &sight);
        if (far)
            add(sums, &node->piece, &mean->moments[i], &sight);
        for (uint32_t k = 0; !far && surface_is_leaf(tree, i) && k < node->count; k++) {
            struct patch patch = patch_of(mean, node->first + k);
            add_patch(sums, &patch);
        }
        i = far ? node->end : i + 1;
    }
}

// A mean is one integral over another: ∇(a/w) = (∇a − (a/w) ∇wᵀ)/w.
bool surface_mean_at(const struct surface_mean *mean, vec3 p, double distance,
                     struct surface_value *out) {
    CHECK(distance >= SURFACE_MEAN_NEAREST_MM);
    double radius = mean->tree->nodes[0].piece.radius;
    struct sums sums = {.p = p, .square = distance * distance, .extent = radius * radius};
    if (!(sums.square < SQUARE_MAX))
        return false;
    walk(mean, &sums);
    if (!(sums.weight > 0))
        return false;
    mat3 zero = {0};
    double scale = 1 / sums.weight;
    vec3 off = vec3_scale(scale, sums.place);
    out->displacement = vec3_scale(scale, sums.field);
    out->point = vec3_add(p, off);
    surface_add_outer(&sums.field_slope, -1, out->displacement, sums.weight_slope);
    surface_add_outer(&sums.place_slope, -1, off, sums.weight_slope);
    out->change = mat3_add_scaled(zero, scale, sums.field_slope);
    out->slide = mat3_add_scaled(mat3_identity(), scale, sums.place_slope);
    return true;
}
