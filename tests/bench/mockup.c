#include "mockup.h"

#include "base/clock.h"
#include "program.h"

#include <errno.h>
#include <math.h>
#include <signal.h>
#include <stdio.h>
#include <string.h>
#include <sys/wait.h>
#include <unistd.h>

static void path_in(const struct mockup *m, const char *name, char *out, size_t size) {
    snprintf(out, size, "%s/%s", m->folder, name);
}

static enum result write_file(const char *path, const char *text, struct error *err) {
    FILE *file = fopen(path, "w");
    bool good = file && fputs(text, file) >= 0;
    good = file && fclose(file) == 0 && good;
    return good ? RESULT_OK : fail(err, RESULT_IO, "%s: %s", path, strerror(errno));
}

static enum result write_motion(const char *path, struct error *err) {
    FILE *file = fopen(path, "w");
    if (!file)
        return fail(err, RESULT_IO, "%s: %s", path, strerror(errno));
    fputs("t_seconds,flexion_deg,varus_deg,internal_deg,shift_mm,drawer_mm,distraction_mm,"
          "probe_tx_mm,probe_ty_mm,probe_tz_mm,probe_qw,probe_qx,probe_qy,probe_qz,probe_valid,"
          "punch_tx_mm,punch_ty_mm,punch_tz_mm,punch_qw,punch_qx,punch_qy,punch_qz,punch_valid,"
          "punch_opening\n",
          file);
    for (int i = 0; i < MOTION_S * MOTION_HZ; i++)
        fprintf(file, "%.2f,%.6f,0,0,0,0,0,%.6f,0,0,1,0,0,0,1,0,0,0,1,0,0,0,0,%.6f\n", i * 0.01,
                MOTION_DEG_PER_S * i * 0.01, MOTION_MM_PER_S * i * 0.01,
                MOTION_OPENING_PER_S * i * 0.01);
    if (fclose(file))
        return fail(err, RESULT_IO, "%s: %s", path, strerror(errno));
    return RESULT_OK;
}

static double bend_at(double seconds) {
    double way = fmod(seconds * BEND_DEG_PER_S, 2 * (BEND_HIGH_DEG - BEND_LOW_DEG));
    return BEND_LOW_DEG + fmin(way, 2 * (BEND_HIGH_DEG - BEND_LOW_DEG) - way);
}

static enum result write_bending(const char *path, struct error *err) {
    FILE *file = fopen(path, "w");
    if (!file)
        return fail(err, RESULT_IO, "%s: %s", path, strerror(errno));
    fputs("t_seconds,flexion_deg,varus_deg,internal_deg,shift_mm,drawer_mm,distraction_mm,"
          "probe_tx_mm,probe_ty_mm,probe_tz_mm,probe_qw,probe_qx,probe_qy,probe_qz,probe_valid\n",
          file);
    for (int i = 0; i < MOTION_S * MOTION_HZ; i++) {
        double deg = bend_at(i * 0.01), half = deg * M_PI / 360;
        fprintf(file, "%.2f,%.6f,0,0,0,0,0,10,20,30,%.12f,%.12f,0,0,1\n", i * 0.01, deg, cos(half),
                sin(half));
    }
    if (fclose(file))
        return fail(err, RESULT_IO, "%s: %s", path, strerror(errno));
    return RESULT_OK;
}

struct play {
    const char *faults;
    double tracker_hz, registers_hz;
    bool bends; // else the steady motion, with serial line and handle
};

static bool has_handle(const struct play *play) {
    return !play->bends && !mockup_without_hid();
}

static enum result read_addresses(struct mockup *m, int fd, const struct play *play,
                                  struct error *err) {
    FILE *out = fdopen(fd, "r");
    char line[256];
    int seen = 0, wanted = 2 + !play->bends + has_handle(play);
    while (seen < wanted && fgets(line, sizeof line, out)) {
        seen++;
        if (sscanf(line, "modbus-tcp %63s", m->modbus_tcp) != 1)
            sscanf(line, "tracker %63s", m->tracker);
    }
    fclose(out);
    m->start_ns = clock_now_ns();
    return seen == wanted ? RESULT_OK : fail(err, RESULT_CLOSED, "arthron-mockup ended at once");
}

static enum result spawn(struct mockup *m, const struct play *play, struct error *err) {
    char rate[32], registers[32], faults[128];
    int out;
    struct program program = {.words = {"arthron-mockup", "--motion", m->motion, "--modbus-tcp",
                                        "127.0.0.1:0", "--modbus-rate", registers, "--tracker",
                                        "127.0.0.1:0", "--rate", rate, "--faults", faults},
                              .cpu = -1};
    const char **next = program.words + 13;
    snprintf(rate, sizeof rate, "%g", play->tracker_hz);
    snprintf(registers, sizeof registers, "%g", play->registers_hz);
    path_in(m, "faults.ini", faults, sizeof faults);
    if (!play->bends) {
        *next++ = "--modbus-rtu";
        *next++ = m->serial;
        *next++ = "--slaves";
        *next++ = "2";
    }
    if (has_handle(play)) {
        *next++ = "--hid";
        *next++ = m->hid;
        *next++ = "--hid-rate";
        *next++ = rate;
    }
    enum result result = program_start(&program, &m->pid, &out, err);
    return result == RESULT_OK ? read_addresses(m, out, play, err) : result;
}

static enum result start(const struct play *play, struct mockup *m, struct error *err) {
    char path[128];
    *m = (struct mockup){0};
    folder_make(m->folder);
    snprintf(m->hid, sizeof m->hid, "%s", strrchr(m->folder, '/') + 1);
    path_in(m, "motion.csv", m->motion, sizeof m->motion);
    path_in(m, "line", m->serial, sizeof m->serial);
    path_in(m, "faults.ini", path, sizeof path);
    enum result result = play->bends ? write_bending(m->motion, err) : write_motion(m->motion, err);
    if (result == RESULT_OK)
        result = write_file(path, play->faults, err);
    if (result == RESULT_OK)
        result = spawn(m, play, err);
    if (result != RESULT_OK)
        mockup_end(m);
    return result;
}

enum result mockup_start(const char *faults, double rate_hz, struct mockup *m, struct error *err) {
    return start(&(struct play){faults, rate_hz, rate_hz, false}, m, err);
}

enum result mockup_start_bending(const char *faults, double tracker_hz, struct mockup *m,
                                 struct error *err) {
    return start(&(struct play){faults, tracker_hz, BEND_REGISTERS_HZ, true}, m, err);
}

void mockup_end(struct mockup *m) {
    if (m->pid > 0) {
        kill(m->pid, SIGTERM);
        waitpid(m->pid, NULL, 0);
    }
    folder_remove(m->folder);
}

const char *mockup_without_hid(void) {
    if (access("/dev/uhid", F_OK))
        return "no /dev/uhid";
    if (access("/dev/uhid", R_OK | W_OK))
        return "/dev/uhid is not ours to use";
    return access("/sys/class/hidraw", F_OK) ? "no hidraw" : NULL;
}
