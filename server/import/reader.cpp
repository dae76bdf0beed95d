#include "import/reader.h"

#include "case/copy_out.hpp"
#include "case/files.h"
#include "case/gltf_scene.h"
#include "import/claim.h"
#include "import/vtk.h"

#include <OpenMesh/Core/IO/IOManager.hh>
#include <OpenMesh/Core/IO/MeshIO.hh>
#include <OpenMesh/Core/System/omstream.hh>
#include <array>
#include <cfloat>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <map>
#include <string>
#include <strings.h>
#include <vector>

namespace {

using namespace OpenMesh;

// OpenMesh's own importer builds half-edges, which splits what is not manifold and aborts on bad
// indices. This one keeps what the file says.
class collector final : public IO::BaseImporter {
  public:
    explicit collector(uint32_t triangles_max) : triangles_max_(triangles_max) {}

    std::vector<double> positions;
    std::vector<uint32_t> triangles;
    uint32_t faces = 0, dropped = 0;
    bool too_many = false;

    VertexHandle add_vertex(const Vec3f &point) override {
        if (n_vertices() >= 3 * (size_t)triangles_max_)
            too_many = true;
        else
            positions.insert(positions.end(), {point[0], point[1], point[2]});
        return VertexHandle((int)n_vertices() - 1);
    }

    VertexHandle add_vertex() override {
        return add_vertex(Vec3f(0, 0, 0));
    }

    void set_point(VertexHandle vertex, const Vec3f &point) override {
        for (size_t i = 0; vertex.idx() >= 0 && (size_t)vertex.idx() < n_vertices() && i < 3; i++)
            positions[3 * (size_t)vertex.idx() + i] = point[i];
    }

    FaceHandle add_face(const VHandles &corners) override {
        faces++;
        dropped += corners.size() < 3;
        for (size_t i = 2; i < corners.size() && !too_many; i++)
            add_triangle(corners[0], corners[i - 1], corners[i]);
        return FaceHandle((int)n_faces() - 1);
    }

    size_t n_vertices() const override {
        return positions.size() / 3;
    }
    size_t n_faces() const override {
        return triangles.size() / 3;
    }
    size_t n_edges() const override {
        return 0;
    }
    BaseKernel *kernel() override {
        return &kernel_;
    }

    // Nothing but points and faces is kept.
    HalfedgeHandle add_edge(VertexHandle, VertexHandle) override {
        return HalfedgeHandle();
    }
    FaceHandle add_face(HalfedgeHandle) override {
        return FaceHandle();
    }
    void add_face_texcoords(FaceHandle, VertexHandle, const std::vector<Vec2f> &) override {}
    void add_face_texcoords(FaceHandle, VertexHandle, const std::vector<Vec3f> &) override {}
    void set_face_texindex(FaceHandle, int) override {}
    void set_halfedge(VertexHandle, HalfedgeHandle) override {}
    void set_normal(VertexHandle, const Vec3f &) override {}
    void set_normal(VertexHandle, const Vec3d &) override {}
    void set_color(VertexHandle, const Vec3uc &) override {}
    void set_color(VertexHandle, const Vec4uc &) override {}
    void set_color(VertexHandle, const Vec3f &) override {}
    void set_color(VertexHandle, const Vec4f &) override {}
    void set_texcoord(VertexHandle, const Vec2f &) override {}
    void set_status(VertexHandle, const Attributes::StatusInfo &) override {}
    void set_next(HalfedgeHandle, HalfedgeHandle) override {}
    void set_face(HalfedgeHandle, FaceHandle) override {}
    void request_face_texcoords2D() override {}
    void set_texcoord(HalfedgeHandle, const Vec2f &) override {}
    void set_texcoord(VertexHandle, const Vec3f &) override {}
    void set_texcoord(HalfedgeHandle, const Vec3f &) override {}
    void set_status(HalfedgeHandle, const Attributes::StatusInfo &) override {}
    void set_color(EdgeHandle, const Vec3uc &) override {}
    void set_color(EdgeHandle, const Vec4uc &) override {}
    void set_color(EdgeHandle, const Vec3f &) override {}
    void set_color(EdgeHandle, const Vec4f &) override {}
    void set_status(EdgeHandle, const Attributes::StatusInfo &) override {}
    void set_normal(FaceHandle, const Vec3f &) override {}
    void set_normal(FaceHandle, const Vec3d &) override {}
    void set_color(FaceHandle, const Vec3uc &) override {}
    void set_color(FaceHandle, const Vec4uc &) override {}
    void set_color(FaceHandle, const Vec3f &) override {}
    void set_color(FaceHandle, const Vec4f &) override {}
    void set_status(FaceHandle, const Attributes::StatusInfo &) override {}
    void add_texture_information(int, std::string) override {}

  private:
    void add_triangle(VertexHandle a, VertexHandle b, VertexHandle c) {
        if (n_faces() >= triangles_max_)
            too_many = true;
        else if (a == b || b == c || c == a)
            dropped++;
        else // a bad index becomes a huge one, found when all vertices are known
            triangles.insert(triangles.end(),
                             {(uint32_t)a.idx(), (uint32_t)b.idx(), (uint32_t)c.idx()});
    }

    BaseKernel kernel_;
    uint32_t triangles_max_;
};

// What a reader leaves out by itself counts as dropped.
enum result compare(const char *path, collector &from, const import_claim &claim,
                    struct error *err) {
    bool soup = claim.vertices == IMPORT_UNKNOWN;
    if (!soup && from.n_vertices() != claim.vertices)
        return fail(err, RESULT_FORMAT, "%s: %zu vertices arrived of %u", path, from.n_vertices(),
                    claim.vertices);
    uint32_t expected = claim.faces - claim.repeated;
    if (soup ? from.faces > expected : from.faces != expected)
        return fail(err, RESULT_FORMAT, "%s: %u faces arrived of %u", path, from.faces, expected);
    from.dropped += claim.faces - from.faces;
    return RESULT_OK;
}

// OpenMesh's STL reader joins corners whose floats are equal.
using place = std::array<float, 3>;

place place_of(const double *p) {
    return {(float)p[0], (float)p[1], (float)p[2]};
}

// The vertex of each position that the file names; false where the reader has made others.
bool match_vertices(const collector &from, const import_claim &claim, std::vector<size_t> &out) {
    bool soup = claim.vertices == IMPORT_UNKNOWN;
    std::map<place, size_t> known;
    for (size_t i = 0; i < claim.position_count; i++)
        out.push_back(
            soup ? known.emplace(place_of(claim.positions + 3 * i), known.size()).first->second
                 : i);
    return (soup ? known.size() : out.size()) == from.n_vertices();
}

enum result beyond_reach(const char *path, size_t vertex, struct error *err) {
    return fail(err, RESULT_INVALID, "%s: vertex %zu lies beyond 10 m, or is no number", path,
                vertex);
}

bool are_one_number(double exact, double rounded) {
    return fabs(exact - rounded) <= FLT_EPSILON * fabs(exact) + FLT_MIN;
}

// OpenMesh reads all numbers as floats: those of the claim take their place, if they are the same.
enum result refine(const char *path, collector &from, const import_claim &claim,
                   struct error *err) {
    std::vector<size_t> vertices;
    if (!claim.positions)
        return RESULT_OK;
    for (size_t i = 0; i < 3 * (size_t)claim.position_count; i++)
        if (!(fabs(claim.positions[i]) <= FLT_MAX))
            return beyond_reach(path, i / 3, err);
    if (!match_vertices(from, claim, vertices))
        return fail(err, RESULT_FORMAT, "%s: %zu vertices arrived, and others than the file names",
                    path, from.n_vertices());
    for (size_t i = 3 * vertices.size(); i-- > 0;) { // the first of equal ones stays
        double exact = claim.positions[i], &arrived = from.positions[3 * vertices[i / 3] + i % 3];
        if (!are_one_number(exact, arrived))
            return fail(err, RESULT_FORMAT, "%s: vertex %zu: %.9g arrived of %.9g", path, i / 3,
                        arrived, exact);
        arrived = exact;
    }
    return RESULT_OK;
}

enum result hand_over(const char *path, const collector &from, import_arrays &out,
                      struct error *err) {
    if (from.too_many)
        return fail(err, RESULT_LIMIT, "%s: more triangles or vertices than are accepted", path);
    if (from.triangles.empty())
        return fail(err, RESULT_FORMAT, "%s: holds no triangle", path);
    for (size_t i = 0; i < from.triangles.size(); i++)
        if (from.triangles[i] >= from.n_vertices())
            return fail(err, RESULT_FORMAT, "%s: triangle %zu: there is no vertex %d", path, i / 3,
                        (int)from.triangles[i]);
    for (size_t i = 0; i < from.positions.size(); i++)
        if (!std::isfinite(from.positions[i]))
            return beyond_reach(path, i / 3, err);
    out.positions = copy_out(from.positions);
    out.triangles = copy_out(from.triangles);
    out.vertex_count = (uint32_t)from.n_vertices();
    out.triangle_count = (uint32_t)from.n_faces();
    out.dropped = from.dropped;
    return RESULT_OK;
}

// 3D Slicer writes SPACE=LPS or SPACE=RAS into comments, titles and headers.
enum result find_space(const char *path, char out_space[4], struct error *err) {
    char head[1024] = "";
    FILE *file = fopen(path, "rb");
    size_t got = file ? fread(head, 1, sizeof head - 1, file) : 0;
    bool readable = file && !ferror(file);
    if (file)
        fclose(file);
    if (!readable)
        return fail(err, RESULT_IO, "%s: cannot be read", path);
    for (size_t i = 0; i + 9 <= got; i++) {
        if (memcmp(head + i, "SPACE=", 6) == 0) {
            memcpy(out_space, head + i + 6, 3);
            break;
        }
    }
    return RESULT_OK;
}

struct scene_holder {
    gltf_scene scene = {};
    ~scene_holder() {
        free(scene.positions);
        free(scene.triangles);
    }
};

enum result read_gltf(const char *path, uint32_t triangles_max, import_arrays &out,
                      struct error *err) {
    uint8_t *bytes = nullptr;
    size_t size;
    scene_holder held;
    const gltf_scene &scene = held.scene;
    enum result result = files_read(path, UINT32_MAX, &bytes, &size, err);
    if (result != RESULT_OK)
        return result;
    result = gltf_read_scene(bytes, size, triangles_max, &held.scene, err);
    free(bytes);
    if (result != RESULT_OK)
        return fail_in(err, result, "%s: ", path);
    collector all(triangles_max);
    all.positions.assign(scene.positions, scene.positions + 3 * (size_t)scene.vertex_count);
    for (uint32_t t = 0; t < scene.triangle_count; t++) {
        const uint32_t *v = scene.triangles + 3 * (size_t)t;
        all.add_face({VertexHandle((int)v[0]), VertexHandle((int)v[1]), VertexHandle((int)v[2])});
    }
    return hand_over(path, all, out, err);
}

bool ends_in(const char *path, const char *ending) {
    const char *dot = strrchr(path, '.');
    return dot && strcasecmp(dot, ending) == 0;
}

struct claim_holder {
    import_claim claim = {};
    ~claim_holder() {
        import_claim_fini(&claim);
    }
};

enum result read_with_openmesh(const char *path, uint32_t triangles_max, import_arrays &out,
                               struct error *err) {
    claim_holder held;
    const import_claim &claim = held.claim;
    enum result result = import_claim_of(path, 3 * triangles_max, &held.claim, err);
    if (result != RESULT_OK)
        return result;
    omlog().disable();
    omout().disable();
    omerr().disable();
    collector mesh(triangles_max);
    IO::Options options;
    if (!IO::IOManager().read(path, mesh, options))
        return fail(err, RESULT_FORMAT, "%s: not readable as a file of this extension", path);
    if (!mesh.too_many)
        result = compare(path, mesh, claim, err);
    if (result == RESULT_OK && !mesh.too_many)
        result = refine(path, mesh, claim, err);
    return result == RESULT_OK ? hand_over(path, mesh, out, err) : result;
}

} // namespace

enum result import_reader_read(const char *path, uint32_t triangles_max,
                               struct import_arrays *out_arrays, struct error *err) {
    *out_arrays = {};
    enum result result;
    try {
        if (ends_in(path, ".vtk"))
            result = vtk_read(path, triangles_max, out_arrays, err);
        else if (ends_in(path, ".glb") || ends_in(path, ".gltf"))
            result = read_gltf(path, triangles_max, *out_arrays, err);
        else
            result = read_with_openmesh(path, triangles_max, *out_arrays, err);
    } catch (const std::exception &why) {
        result = fail(err, RESULT_FORMAT, "%s: not readable: %s", path, why.what());
    }
    if (result == RESULT_OK)
        result = find_space(path, out_arrays->space, err);
    if (result != RESULT_OK)
        import_arrays_fini(out_arrays);
    return result;
}

void import_arrays_fini(struct import_arrays *arrays) {
    free(arrays->positions);
    free(arrays->triangles);
    *arrays = {};
}
