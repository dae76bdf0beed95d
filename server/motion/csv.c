#include "motion/motion.h"

#include <errno.h>
#include <string.h>

static void write_header(const struct motion *motion, FILE *file) {
    static const char *const columns[] = {"tx_mm", "ty_mm", "tz_mm", "qw",     "qx",
                                          "qy",    "qz",    "valid", "opening"};
    fputs("t_seconds,flexion_deg,varus_deg,internal_deg,shift_mm,drawer_mm,distraction_mm", file);
    for (int tool = 0; tool < motion->tool_count; tool++)
        for (size_t i = 0; i < sizeof columns / sizeof *columns; i++)
            fprintf(file, ",%s_%s", channel_name(motion->tools[tool].channel), columns[i]);
    fputs(",touch\n", file);
}

static void write_row(const struct motion *motion, const struct motion_row *row, FILE *file) {
    const struct joint_angles *j = &row->joint;
    fprintf(file, "%.6f,%.6f,%.6f,%.6f,%.6f,%.6f,%.6f", row->t_seconds, j->flexion_deg,
            j->varus_deg, j->internal_deg, j->shift_mm, j->drawer_mm, j->distraction_mm);
    for (int tool = 0; tool < motion->tool_count; tool++) {
        const struct motion_tool_state *state = &row->tools[tool];
        vec3 t = state->T_mockup_tip.translation;
        quat q = state->T_mockup_tip.rotation;
        fprintf(file, ",%.6f,%.6f,%.6f,%.9f,%.9f,%.9f,%.9f,1,%.4f", t.x, t.y, t.z, q.w, q.x, q.y,
                q.z, state->opening);
    }
    fprintf(file, ",%s\n", row->touch ? row->touch->name : "-");
}

enum result motion_write(const struct motion *motion, FILE *file, struct error *err) {
    write_header(motion, file);
    for (size_t i = 0; i < motion->row_count; i++)
        write_row(motion, &motion->rows[i], file);
    if (fflush(file) != 0 || ferror(file))
        return fail(err, RESULT_IO, "writing rows: %s", strerror(errno));
    return RESULT_OK;
}
