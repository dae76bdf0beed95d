// What the mock-up program refuses: arguments, and files of faults.

#include "../../station/mockup/faults.h"
#include "in_folder.h"
#include "mockup_program.h"
#include "test.h"

#include <stdio.h>
#include <string.h>
#include <unistd.h>

static const char *written(const char *name, const char *text) {
    const char *path = in_folder(name);
    FILE *file = fopen(path, "w");
    fputs(text, file);
    fclose(file);
    return path;
}

static void the_command_line_is_checked(void **state) {
    (void)state;
    const char *motion =
        written("motion.csv", "t_seconds,flexion_deg,varus_deg,internal_deg,shift_mm,"
                              "drawer_mm,distraction_mm\n0,1,0,0,0,0,0\n1,2,0,0,0,0,0\n");
    const char *plain = written("plain.csv", "t_seconds,tx_mm,ty_mm,tz_mm,qw,qx,qy,qz,valid\n"
                                             "0,0,0,0,1,0,0,0,1\n1,0,0,0,1,0,0,0,1\n");
    const struct {
        int code;
        const char *arguments[8];
    } rows[] = {
        {2, {NULL}},
        {2, {"--motion", motion}},
        {2, {"--motion", motion, "--tool", "probe", "--tracker", "127.0.0.1:0"}},
        {2, {"--motion", motion, "--recording", plain, "--tracker", "127.0.0.1:0"}},
        {2, {"--recording", plain, "--tracker", "127.0.0.1:0"}},
        {2, {"--recording", plain, "--tool", "hammer", "--tracker", "127.0.0.1:0"}},
        {2, {"--motion", motion, "--tracker", "127.0.0.1:0", "--message", "IMAGE"}},
        {2, {"--motion", motion, "--tracker", "127.0.0.1:0", "--header-version", "4"}},
        {2, {"--motion", motion, "--tracker", "127.0.0.1:0", "--rate", "0"}},
        {2, {"--motion", motion, "--tracker", "127.0.0.1:0", "--T-tool-tip", "probe=1"}},
        {2, {"--motion", motion, "--tracker", "127.0.0.1:0", "--T-tracker-mockup", "here"}},
        {2, {"--motion", motion, "--tracker", "127.0.0.1:0", "extra"}},
        {2, {"--fly"}},
        {1, {"--motion", plain, "--tracker", "127.0.0.1:0"}},
        {1, {"--motion", "/nowhere.csv", "--tracker", "127.0.0.1:0"}},
        {1, {"--motion", motion, "--tracker", "nowhere"}},
        {1, {"--motion", motion, "--tracker", "192.0.2.1:0"}},
        {1, {"--motion", motion, "--modbus-rtu", motion}},
        {1, {"--motion", motion, "--tracker", "127.0.0.1:0", "--faults", motion}},
    };
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        struct mockup m = started(0, rows[i].arguments);
        int code = ended(&m, 0);
        if (code != rows[i].code)
            fail_msg("row %zu: exit %d, not %d", i, code, rows[i].code);
    }
    assert_int_equal(0, access(motion, R_OK)); // the refused --modbus-rtu left it alone
}

static void a_file_of_faults_is_checked(void **state) {
    (void)state;
    const struct {
        const char *file, *complaint;
    } rows[] = {
        {"[fault a]\nwho = camera\n", "line 2"},
        {"[fault a]\nwhat = boredom\n", "line 2"},
        {"[fault a]\nat_s = soon\n", "line 2"},
        {"[fault a]\nevery = 0\n", "line 2"},
        {"[fault a]\nhow = badly\n", "line 2"},
        {"[flaw a]\nwho = modbus\n", "line 2"},
        {"at_s = 1\n", "line 1"},
        {"[fault a]\nwho = modbus\nwhat = freeze\nat_s = 1\n", "[fault a]: needs"},
        {"[fault a]\nwho=modbus\nwhat=clock-step\nvalue=1\nat_s=1\nfor_s=1\n", "modbus has no"},
        {"[fault a]\nwho=tracker\nwhat=wrong-slave\nat_s=1\nfor_s=1\n", "tracker has no"},
        {"[fault a]\nwho=tracker\nwhat=jump\nat_s=1\nfor_s=1\n", "needs a value"},
        {"[fault a]\nwho=tracker\nwhat=junk\nvalue=1\nat_s=1\nfor_s=1\n", "takes no value"},
        {"[fault a]\nwho=tracker\nwhat=late\nvalue=-1\nat_s=1\nfor_s=1\n", "0 to 10000"},
    };
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        struct faults faults = {0};
        struct error err;
        if (faults_read(written("faults.ini", rows[i].file), &faults, &err) == RESULT_OK ||
            !strstr(err.text, rows[i].complaint))
            fail_msg("row %zu: %s", i, err.text);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_command_line_is_checked),
        cmocka_unit_test(a_file_of_faults_is_checked),
    };
    return cmocka_run_group_tests_name("mockup_options", tests, make_folder, remove_folder);
}
