// A task on a case: its landmarks, lines and tools found, and what hides one thing from another.
#pragma once

#include "base/instrument.h"
#include "mesh/sight.h"
#include "step/optic.h"
#include "step/output.h"
#include "step/scene.h"
#include "task/task.h"

#define SITE_LINE_MAX 256 // points of a line, about 1 mm apart

#define SITE_SHOWN_MAX 6
#define SITE_SHOWN_MM 8.0

// A landmark, in the frame of its body. It belongs to the group that it lies in, or else nearest
// to.
struct spot {
    enum body body;
    int group;
    vec3 at;         // on or in the mock-up (S)
    double depth_mm; // from it to the surface
    // Vertices of the patient's surface (S'): the nearest in each direction of the axes, not
    // farther from it than depth_mm + SITE_SHOWN_MM. Who sees one of them sees the landmark.
    int shown_count;
    vec3 shown[SITE_SHOWN_MAX];
    vec3 middle; // of a ball round them
    double radius_mm;
};

struct site_goal {
    struct spot see, touch;
    int tool;                      // index of the session's instruments
    int tissue;                    // that `resect` names
    uint32_t loose;                // that `take_out` names, a bit each
    int scope_portal, tool_portal; // -1: any
    double seen_cosine;            // of the widest angle from where the optic looks
    int line_count;                // 0: no line
    vec3 line[SITE_LINE_MAX];      // on S, in the frame of touch.body
};

struct site;

struct view_optic task_optic(const struct task *task); // the usual one, tilted as the task needs

// The task and the scene must outlive the site unchanged; any number of attempts on any threads
// share one. RESULT_MISSING: the case has no such landmark, group or tool; the error names goal or
// error, and key. RESULT_INVALID: a line is longer than 255 mm or leaves its surface, or the task
// needs another optic; RESULT_IO:
// Embree cannot build. The caller destroys it.
enum result site_create(const struct task *task, const struct scene *scene,
                        const struct instruments *tools, const struct view_optic *optic,
                        struct site **out_site, struct error *err);
void site_destroy(struct site **site); // NULL inside is fine; *site becomes NULL

const struct task *site_task(const struct site *site);
const struct site_goal *site_goal(const struct site *site, int goal);
const struct instruments *site_tools(const struct site *site);
const struct view_optic *site_optic(const struct site *site);

const struct knee_case *site_case(const struct site *site);
int site_tissue(const struct site *site, int group); // index of what can be cut; -1: it cannot

// Whether the error is about this tool, and about this group.
bool site_error_concerns(const struct site *site, int error, int tool);
bool site_error_has_group(const struct site *site, int error, int group);

// Whether no surface as the patient has it lies between two points of the mock-up's frame.
// Ligaments that bridge two bones and the skin hide nothing. Neither does a tissue from which
// something was cut (`cut`, a bit each), nor what lies within SITE_SPARE_MM of `to`. The hint's
// mesh is a group of the case.
#define SITE_SPARE_MM 3.0
bool site_sees(const struct site *site, const pose T_mockup_virtual[BODY_COUNT], vec3 from,
               uint32_t cut, vec3 to, struct sight_hint *hint);
