// Files that a person writes: what is wrong in one is named, with what would have been right.
#include "settings/settings.h"

#include "folder.h"
#include "test.h"

#include <stdio.h>
#include <string.h>

struct room {
    char name[16], door[64];
    int port, mode;
    double size_m;
    bool lit;
    int lamps;
};

struct house {
    int count;
    struct room rooms[2];
};

static char dir[FOLDER_MAX];
static struct house house;
static struct error err;

static bool take_lamp(void *target, const char *rest, const char *value) {
    struct room *room = target;
    if (strcmp(rest, "left") || strcmp(value, "on"))
        return false;
    room->lamps++;
    return true;
}

static void *find_hall(void *user, const char *name, struct error *why) {
    (void)name, (void)why;
    return &((struct house *)user)->rooms[0];
}

static void *find_room(void *user, const char *name, struct error *why) {
    struct house *h = user;
    if (!strcmp(name, "attic")) {
        strcpy(why->text, "this house has no attic");
        return NULL;
    }
    snprintf(h->rooms[1].name, sizeof h->rooms[1].name, "%s", name);
    return &h->rooms[1];
}

static const char *const modes[] = {"auto", "command", NULL};
static const struct setting_key keys[] = {
    {"name", SETTING_TEXT, SETTING_IN(struct room, name)},
    {"door", SETTING_PATH, SETTING_IN(struct room, door)},
    {"port", SETTING_INTEGER, SETTING_IN(struct room, port), 1, 65535},
    {"mode", SETTING_CHOICE, SETTING_IN(struct room, mode), .choices = modes},
    {"size_m", SETTING_NUMBER, SETTING_IN(struct room, size_m), 0.5, 20},
    {"lit", SETTING_SWITCH, SETTING_IN(struct room, lit)},
    {"lamp.", .take = take_lamp, .wanted = "on, of lamp.left"},
    {0},
};
static const struct setting_section sections[] = {
    {"hall", keys, find_hall}, {"room NAME", keys, find_room}, {0}};

static int begin(void **state) {
    (void)state;
    folder_make(dir);
    return 0;
}

static int end(void **state) {
    (void)state;
    folder_remove(dir);
    return 0;
}

static enum result load_with(const char *text, const struct setting_override *override) {
    char path[FOLDER_MAX + 16];
    snprintf(path, sizeof path, "%s/house.ini", dir);
    FILE *file = fopen(path, "w");
    fputs(text, file);
    fclose(file);
    memset(&house, 0, sizeof house);
    err.text[0] = '\0';
    return settings_load(path, override, override ? 1 : 0, sections, &house, &err);
}

static void values_go_where_the_tables_say(void **state) {
    (void)state;
    assert_int_equal(load_with("[hall]\nport = 80\nmode = command\nsize_m = 2.5\nlit = yes\n"
                               "lamp.left = on\ndoor = /d\n[room of many words]\nport = 7\n",
                               NULL),
                     RESULT_OK);
    const struct room *hall = &house.rooms[0];
    assert_int_equal(hall->port, 80);
    assert_int_equal(hall->mode, 1);
    assert_true(hall->size_m == 2.5);
    assert_true(hall->lit);
    assert_int_equal(hall->lamps, 1);
    assert_string_equal(hall->door, "/d");
    assert_string_equal(house.rooms[1].name, "of many words");
    assert_int_equal(house.rooms[1].port, 7);
}

static void an_override_wins_and_may_repeat_a_key(void **state) {
    (void)state;
    struct setting_override override = {"hall", "port", "81"};
    assert_int_equal(load_with("[hall]\nport = 80\n", &override), RESULT_OK);
    assert_int_equal(house.rooms[0].port, 81);
    override.value = "99999";
    assert_int_equal(load_with("[hall]\n", &override), RESULT_INVALID);
    assert_string_equal(err.text,
                        "--set: [hall] port = 99999: must be a whole number from 1 to 65535");
}

// What is wrong, and what the error says behind the path.
static void what_is_wrong_is_named_with_what_is_right(void **state) {
    (void)state;
    char long_line[400] = "[hall]\nname = ";
    memset(long_line + strlen(long_line), 'x', 300);
    static const struct {
        const char *text, *says;
        enum result result;
    } rows[] = {
        {"[hal]\nport = 1\n", "line 2: there is no section [hal]; did you mean [hall]?",
         RESULT_INVALID},
        {"[rom 1]\nport = 1\n", "line 2: there is no section [rom 1]; did you mean [room NAME]?",
         RESULT_INVALID},
        {"[room]\nport = 1\n", "line 2: there is no section [room]; did you mean [room NAME]?",
         RESULT_INVALID},
        {"[garden]\nport = 1\n",
         "line 2: there is no section [garden]; the sections are [hall], [room NAME]",
         RESULT_INVALID},
        {"port = 1\n",
         "line 1: no [section] stands before it; the sections are [hall], [room NAME]",
         RESULT_INVALID},
        {"[room attic]\nport = 1\n", "line 2: [room attic]: this house has no attic",
         RESULT_INVALID},
        {"[hall]\nprot = 1\n", "line 2: [hall] has no key \"prot\"; did you mean port?",
         RESULT_INVALID},
        {"[hall]\ncolour = 1\n",
         "line 2: [hall] has no key \"colour\"; its keys are name, door, port, mode, size_m, lit, "
         "lamp.",
         RESULT_INVALID},
        {"[hall]\n\nport = 99999\n",
         "line 3: [hall] port = 99999: must be a whole number from 1 to 65535", RESULT_INVALID},
        {"[hall]\nsize_m = x\n", "line 2: [hall] size_m = x: must be a number from 0.5 to 20",
         RESULT_INVALID},
        {"[hall]\nlit = maybe\n", "line 2: [hall] lit = maybe: must be yes or no", RESULT_INVALID},
        {"[hall]\nmode = comand\n",
         "line 2: [hall] mode = comand: is unknown; did you mean command?", RESULT_INVALID},
        {"[hall]\nmode = later\n",
         "line 2: [hall] mode = later: is unknown; the choices are auto, command", RESULT_INVALID},
        {"[hall]\nname =\n", "line 2: [hall] name = : must not be empty", RESULT_INVALID},
        {"[hall]\nname = a name of many letters\n",
         "line 2: [hall] name = a name of many letters: is too long", RESULT_INVALID},
        {"[hall]\nlamp.right = on\n", "line 2: [hall] lamp.right = on: must be on, of lamp.left",
         RESULT_INVALID},
        {"[hall]\nport = 1\n[room a]\nport = 2\n[hall]\nlit = no\n",
         "line 5: [hall] begins again; it began in line 1. Join the two", RESULT_INVALID},
        {"[room a]\nport = 1\n[room a]\n",
         "line 3: [room a] begins again; it began in line 1. Join the two", RESULT_INVALID},
        {"[hall]\nport = 1\nlit = no\nport = 2\n",
         "line 4: [hall] port is given again; line 2 gives it too", RESULT_INVALID},
        {"[hall]\nname = a\n  b\n",
         "line 3: begins with a blank, so it goes on with the value of \"name\". Remove the blank",
         RESULT_INVALID},
        {"[hall]\nport\nlit = maybe\n", "line 2 is neither [section] nor key = value",
         RESULT_FORMAT},
        {"[hall\nport = 1\n", "line 1 is neither [section] nor key = value", RESULT_FORMAT},
        {"[room a name that nobody can keep in mind, or in forty-nine bytes]\nport = 1\n",
         "line 1: the name of the section is longer than 49 bytes", RESULT_INVALID},
    };
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        assert_int_equal(load_with(rows[i].text, NULL), rows[i].result);
        const char *behind = strstr(err.text, "line");
        assert_non_null(strstr(err.text, "/house.ini"));
        assert_string_equal(behind, rows[i].says);
    }
    assert_int_equal(load_with(long_line, NULL), RESULT_INVALID);
    assert_non_null(strstr(err.text, "line 2: longer than 198 bytes"));
}

static void equal_keys_of_different_sections_are_no_repetition(void **state) {
    (void)state;
    assert_int_equal(load_with("[hall]\nport = 1\n[room a]\nport = 1\n[room b]\nport = 1\n", NULL),
                     RESULT_OK);
}

static void a_file_that_cannot_be_read_says_why(void **state) {
    (void)state;
    assert_int_equal(settings_load("/nowhere/house.ini", NULL, 0, sections, &house, &err),
                     RESULT_MISSING);
    assert_string_equal(err.text, "/nowhere/house.ini cannot be read: No such file or directory");
    assert_int_equal(settings_load("/", NULL, 0, sections, &house, &err), RESULT_MISSING);
    assert_string_equal(err.text, "/ cannot be read: Is a directory");
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(values_go_where_the_tables_say, begin, end),
        cmocka_unit_test_setup_teardown(an_override_wins_and_may_repeat_a_key, begin, end),
        cmocka_unit_test_setup_teardown(what_is_wrong_is_named_with_what_is_right, begin, end),
        cmocka_unit_test_setup_teardown(equal_keys_of_different_sections_are_no_repetition, begin,
                                        end),
        cmocka_unit_test_setup_teardown(a_file_that_cannot_be_read_says_why, begin, end),
    };
    return cmocka_run_group_tests_name("settings", tests, NULL, NULL);
}
