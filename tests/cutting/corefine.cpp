extern "C" {
#include "cutting/corefine.h"
}

#include <CGAL/Exact_predicates_inexact_constructions_kernel.h>
#include <CGAL/Polygon_mesh_processing/corefinement.h>
#include <CGAL/Polygon_mesh_processing/measure.h>
#include <CGAL/Polygon_mesh_processing/triangulate_faces.h>
#include <CGAL/Surface_mesh.h>
#include <exception>
#include <vector>

using kernel = CGAL::Exact_predicates_inexact_constructions_kernel;
using surface_mesh = CGAL::Surface_mesh<kernel::Point_3>;
using vertex = surface_mesh::Vertex_index;
namespace processing = CGAL::Polygon_mesh_processing;

static vertex add(surface_mesh &mesh, vec3 p) {
    return mesh.add_vertex(kernel::Point_3(p.x, p.y, p.z));
}

static surface_mesh mesh_of(const struct snapshot *surface) {
    surface_mesh mesh;
    std::vector<vertex> vertices(surface->vertex_bound);
    for (uint32_t v = 0; v < surface->vertex_bound; v++)
        if (surface->vertex_alive[v])
            vertices[v] = add(mesh, surface->vertices[v]);
    for (uint32_t t = 0; t < surface->triangle_bound; t++) {
        const uint32_t *v = surface->triangles + 3 * size_t(t);
        if (snapshot_has(surface, t))
            mesh.add_face(vertices[v[0]], vertices[v[1]], vertices[v[2]]);
    }
    return mesh;
}

static surface_mesh mesh_of(const struct convex *convex) {
    surface_mesh mesh;
    std::vector<vertex> vertices;
    for (int v = 0; v < convex->vertex_count; v++)
        vertices.push_back(add(mesh, convex->vertices[v]));
    for (int f = 0; f < convex->plane_count; f++) {
        std::vector<vertex> face;
        for (int i = convex->first_corner[f]; i < convex->first_corner[f + 1]; i++)
            face.push_back(vertices[convex->corners[i]]);
        mesh.add_face(face);
    }
    processing::triangulate_faces(mesh);
    return mesh;
}

bool corefine_difference(const struct snapshot *surface, const struct convex *blade,
                         double *out_volume) {
    try {
        surface_mesh body = mesh_of(surface), taken = mesh_of(blade), left;
        bool done = processing::corefine_and_compute_difference(
            body, taken, left, CGAL::parameters::throw_on_self_intersection(true));
        if (done)
            *out_volume = processing::volume(left);
        return done;
    } catch (const std::exception &) {
        return false;
    }
}
