#include "replay/bites.h"

#include <stdio.h>
#include <string.h>
#include <unistd.h>

// Two instruments, and bites in several places with no reset between some of them.
static const char bites[] = "[motion]\nrate_hz = 100\nspeed_mm_s = 90\njoint_speed_deg_s = 30\n"
                            "tremor_mm = 0.05\nseed = 1\n[steps]\nflex = 20\n"
                            "approach = probe anteromedial\n"
                            "palpate = tibia -26 12 -22 -13 8 -22\napproach = punch anterolateral\n"
                            "bite = punch meniscus_medial -13 12 -20\n"
                            "bite = punch meniscus_medial -24 15 -18\n"
                            "bite = punch meniscus_medial -13 12 -20\n"
                            "bite = punch meniscus_medial -24 15 -18\n"
                            "withdraw = punch\nwithdraw = probe\n";

static enum result plan_bites(struct error *err) {
    struct motion_script script;
    char path[FOLDER_MAX + 32];
    snprintf(path, sizeof path, "%s.ini", trace_path);
    FILE *file = fopen(path, "we");
    fputs(bites, file);
    fclose(file);
    struct knee_case *knee;
    enum result result = motion_script_load(path, &script, err);
    unlink(path);
    motion_fini(&played.motion);
    if (result == RESULT_OK)
        result = case_load(case_dir, NULL, &knee, err);
    if (result != RESULT_OK)
        return result;
    result = motion_plan(knee, &script, &played.motion, err);
    case_destroy(&knee);
    return result;
}

struct trace_header bites_header(void) {
    struct trace_header header = honest_header();
    snprintf(header.case_dir, sizeof header.case_dir, "%s", case_dir);
    snprintf(header.station, sizeof header.station, "bench 3");
    snprintf(header.trainee, sizeof header.trainee, "Anna Amsel");
    memset(header.session_id, 0xA7, sizeof header.session_id);
    return header;
}

int make_bites(void **state) {
    struct error err = {""};
    if (make_session(state) != 0)
        return -1;
    if (plan_bites(&err) != RESULT_OK) {
        fprintf(stderr, "%s\n", err.text);
        return -1;
    }
    struct trace_header header = bites_header();
    record(&header, 0, NULL);
    return 0;
}
