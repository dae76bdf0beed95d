#include "case_landmarks_report.h"

#include "case_landmarks_picture.h"
#include "report/html.h"

#include <errno.h>
#include <jansson.h>
#include <stdio.h>
#include <string.h>

static const char *const sides[] = {"medial", "lateral"};

static bool is_proposed(const struct landmarks_said *said, int portal) {
    return !said->kept.portals && portal < 2 && !said->by_hand[portal];
}

static void print_path(const struct landmarks_said *said) {
    puts("flexion  gap on the axis   gap on the path   distraction  varus  patella's gap");
    puts("    deg  medial lateral    medial lateral             mm    deg             mm");
    for (int i = 0; i < said->path.count; i += 3) {
        const struct path_point *p = &said->path.points[i];
        printf("%7.0f %7.2f %7.2f   %7.2f %7.2f        %7.2f %6.2f", p->flexion_deg,
               p->axes_gap_mm[0], p->axes_gap_mm[1], p->gap_mm[0], p->gap_mm[1], p->distraction_mm,
               p->varus_deg);
        if (isfinite(p->patella_gap_mm))
            printf("        %7.2f", p->patella_gap_mm);
        puts("");
    }
}

static void print_joint(const struct landmarks_said *said) {
    if (!said->has_fit) {
        puts("joint: kept");
        return;
    }
    for (int i = 0; i < COMPARTMENT_COUNT; i++) {
        const struct condyle_fit *fit = &said->joint.condyles[i];
        printf("condyle %-8s centre %.1f %.1f %.1f, radius %.1f mm, residual %.2f mm\n", sides[i],
               fit->centre.x, fit->centre.y, fit->centre.z, fit->radius_mm, fit->rms_mm);
    }
    printf("joint: %s turned by %.1f degrees, moved by %.1f mm%s\n",
           said->kept.joint ? "kept; the fit would be" : "from the condyles,",
           said->joint.turned_deg, said->joint.moved_mm,
           said->kept.joint ? "" : "; it replaces the case's (--keep joint keeps that)");
}

static void print_portals(const struct landmarks_said *said) {
    const struct knee_case *knee = said->knee;
    for (int i = 0; i < knee->portal_count; i++) {
        const struct case_portal *p = &knee->portals[i];
        printf("portal %-16s %.1f %.1f %.1f towards %.2f %.2f %.2f", p->name, p->position.x,
               p->position.y, p->position.z, p->direction.x, p->direction.y, p->direction.z);
        if (said->by_hand[i])
            printf(", by hand");
        else if (is_proposed(said, i))
            printf(", %.1f mm clear of bones", said->clear_mm[i]);
        puts("");
    }
}

void landmarks_print(const struct landmarks_said *said) {
    const struct knee_case *knee = said->knee;
    print_joint(said);
    if (said->path.count)
        print_path(said);
    else
        puts("rest path: kept");
    for (int i = 0; i < knee->landmark_count; i++) {
        const struct case_landmark *l = &knee->landmarks[i];
        printf("%-24s %-8s %7.1f %7.1f %7.1f  ", l->name, body_name(l->body), l->at.x, l->at.y,
               l->at.z);
        if (l->by_hand)
            puts("by hand");
        else
            printf("± %.1f mm\n", l->error_mm);
    }
    for (int i = 0; i < said->notes.count; i++)
        printf("note: %s\n", said->notes.texts[i]);
    print_portals(said);
}

// ---- JSON ---------------------------------------------------------------------------------------

static json_t *vector_json(vec3 v) {
    return json_pack("[f, f, f]", v.x, v.y, v.z);
}

static json_t *json_joint(const struct landmarks_said *said) {
    pose T = said->knee->joint.T_femur_joint;
    json_t *joint = json_pack("{s:b, s:[f, f, f, f, f, f, f]}", "kept", (int)said->kept.joint,
                              "T_femur_joint", T.translation.x, T.translation.y, T.translation.z,
                              T.rotation.w, T.rotation.x, T.rotation.y, T.rotation.z);
    if (!said->has_fit)
        return joint;
    json_t *condyles = json_object();
    for (int i = 0; i < COMPARTMENT_COUNT; i++) {
        const struct condyle_fit *fit = &said->joint.condyles[i];
        json_object_set_new(condyles, sides[i],
                            json_pack("{s:o, s:f, s:f}", "centre", vector_json(fit->centre),
                                      "radius_mm", fit->radius_mm, "rms_mm", fit->rms_mm));
    }
    json_object_set_new(joint, "turned_deg", json_real(said->joint.turned_deg));
    json_object_set_new(joint, "moved_mm", json_real(said->joint.moved_mm));
    json_object_set_new(joint, "condyles", condyles);
    return joint;
}

static json_t *json_path(const struct landmarks_said *said) {
    json_t *path = json_array();
    for (int i = 0; i < said->path.count; i++) {
        const struct path_point *p = &said->path.points[i];
        json_t *row =
            json_pack("{s:f, s:[f, f], s:[f, f], s:f, s:f}", "flexion_deg", p->flexion_deg,
                      "axes_gap_mm", p->axes_gap_mm[0], p->axes_gap_mm[1], "gap_mm", p->gap_mm[0],
                      p->gap_mm[1], "distraction_mm", p->distraction_mm, "varus_deg", p->varus_deg);
        if (isfinite(p->patella_gap_mm))
            json_object_set_new(row, "patella_gap_mm", json_real(p->patella_gap_mm));
        json_array_append_new(path, row);
    }
    return path;
}

void landmarks_print_json(const struct landmarks_said *said) {
    const struct knee_case *knee = said->knee;
    json_t *landmarks = json_array(), *portals = json_array(), *notes = json_array();
    for (int i = 0; i < knee->landmark_count; i++) {
        const struct case_landmark *l = &knee->landmarks[i];
        json_array_append_new(landmarks,
                              json_pack("{s:s, s:s, s:o, s:f, s:s}", "name", l->name, "body",
                                        body_name(l->body), "at", vector_json(l->at), "error_mm",
                                        l->error_mm, "by", l->by_hand ? "hand" : "proposal"));
    }
    for (int i = 0; i < knee->portal_count; i++) {
        const struct case_portal *p = &knee->portals[i];
        json_t *row = json_pack("{s:s, s:o, s:o}", "name", p->name, "position",
                                vector_json(p->position), "direction", vector_json(p->direction));
        if (said->by_hand[i])
            json_object_set_new(row, "by", json_string("hand"));
        else if (is_proposed(said, i))
            json_object_set_new(row, "clear_mm", json_real(said->clear_mm[i]));
        json_array_append_new(portals, row);
    }
    for (int i = 0; i < said->notes.count; i++)
        json_array_append_new(notes, json_string(said->notes.texts[i]));
    json_t *root =
        json_pack("{s:o, s:o, s:o, s:o, s:o}", "joint", json_joint(said), "path", json_path(said),
                  "landmarks", landmarks, "portals", portals, "notes", notes);
    json_dumpf(root, stdout, JSON_INDENT(2) | JSON_REAL_PRECISION(9));
    puts("");
    json_decref(root);
}

// ---- the page -----------------------------------------------------------------------------------

static void write_condyles(FILE *file, const struct landmarks_said *said) {
    if (!said->has_fit) {
        fputs("<p>The joint is kept as it was. No condyles are fitted.</p>\n", file);
        return;
    }
    fprintf(file,
            "<p>The joint is %s. Against the frame before, the fit is turned by %.1f degrees and "
            "moved by %.1f mm.</p>\n<table>\n"
            "<tr><th>condyle</th><th>centre of the circle</th><th>radius, mm</th><th>residual, "
            "mm</th></tr>\n",
            said->kept.joint ? "kept as it was" : "that of the posterior condyles",
            said->joint.turned_deg, said->joint.moved_mm);
    for (int i = 0; i < COMPARTMENT_COUNT; i++) {
        const struct condyle_fit *fit = &said->joint.condyles[i];
        fprintf(file, "<tr><td>%s</td><td>%.1f %.1f %.1f</td><td>%.1f</td><td>%.2f</td></tr>\n",
                sides[i], fit->centre.x, fit->centre.y, fit->centre.z, fit->radius_mm, fit->rms_mm);
    }
    fputs("</table>\n", file);
}

static void write_path(FILE *file, const struct landmarks_said *said) {
    if (said->path.count == 0)
        return;
    fputs("<h2>The joint over flexion</h2>\n<p>Gaps of femur and tibia, medial and lateral, mm. "
          "Negative gaps are overlaps.</p>\n<table>\n<tr><th>flexion, degrees</th><th>about the "
          "fixed axis</th><th>on the path</th><th>distraction, mm</th><th>varus, degrees</th>"
          "<th>gap of the patella, mm</th></tr>\n",
          file);
    for (int i = 0; i < said->path.count; i++) {
        const struct path_point *p = &said->path.points[i];
        fprintf(file,
                "<tr><td>%.0f</td><td>%.2f, %.2f</td><td>%.2f, %.2f</td><td>%.2f</td><td>%.2f</td>",
                p->flexion_deg, p->axes_gap_mm[0], p->axes_gap_mm[1], p->gap_mm[0], p->gap_mm[1],
                p->distraction_mm, p->varus_deg);
        if (isfinite(p->patella_gap_mm))
            fprintf(file, "<td>%.2f</td></tr>\n", p->patella_gap_mm);
        else
            fputs("<td></td></tr>\n", file);
    }
    fputs("</table>\n", file);
}

static void write_places(FILE *file, const struct landmarks_said *said) {
    const struct knee_case *knee = said->knee;
    fputs("<h2>Landmarks and portals</h2>\n<p>Each in the frame of its body, mm: x to the right, y "
          "anterior, z proximal.</p>\n<table>\n<tr><th>landmark</th><th>body</th><th>place</th>"
          "<th>may be off by, mm</th></tr>\n",
          file);
    for (int i = 0; i < knee->landmark_count; i++) {
        const struct case_landmark *l = &knee->landmarks[i];
        fprintf(file, "<tr><td>%s</td><td>%s</td><td>%.1f %.1f %.1f</td>", l->name,
                body_name(l->body), l->at.x, l->at.y, l->at.z);
        if (l->by_hand)
            fputs("<td>given by hand</td></tr>\n", file);
        else
            fprintf(file, "<td>%.1f</td></tr>\n", l->error_mm);
    }
    fputs("</table>\n<table>\n<tr><th>portal</th><th>place</th><th>direction</th><th>clear of "
          "bones by, mm</th></tr>\n",
          file);
    for (int i = 0; i < knee->portal_count; i++) {
        const struct case_portal *p = &knee->portals[i];
        fprintf(file, "<tr><td>%s</td><td>%.1f %.1f %.1f</td><td>%.2f %.2f %.2f</td>", p->name,
                p->position.x, p->position.y, p->position.z, p->direction.x, p->direction.y,
                p->direction.z);
        if (said->by_hand[i])
            fputs("<td>given by hand</td></tr>\n", file);
        else if (is_proposed(said, i))
            fprintf(file, "<td>%.1f</td></tr>\n", said->clear_mm[i]);
        else
            fputs("<td></td></tr>\n", file);
    }
    fputs("</table>\n", file);
}

static void write_notes(FILE *file, const struct landmarks_said *said) {
    for (int i = 0; i < said->notes.count; i++) {
        fputs("<p>Note: ", file);
        html_text(file, said->notes.texts[i]);
        fputs("</p>\n", file);
    }
}

static enum result write_landmarks_page(FILE *file, const struct landmarks_said *said,
                                        struct error *err) {
    char title[CASE_NAME_MAX + 32];
    snprintf(title, sizeof title, "Landmarks of %s", said->knee->name);
    html_begin(file, title);
    write_condyles(file, said);
    enum result result = landmarks_pictures(file, said->knee, err);
    write_places(file, said);
    write_path(file, said);
    write_notes(file, said);
    html_end(file);
    return result;
}

enum result landmarks_report(const struct landmarks_said *said, const char *path,
                             struct error *err) {
    FILE *file = fopen(path, "w");
    if (!file)
        return fail(err, RESULT_IO, "%s: %s", path, strerror(errno));
    enum result result = write_landmarks_page(file, said, err);
    bool written = !ferror(file);
    if ((fclose(file) != 0 || !written) && result == RESULT_OK)
        result = fail(err, RESULT_IO, "%s: %s", path, strerror(errno));
    return result;
}
