#include "check/standing.h"

#include <limits.h>
#include <stdio.h>
#include <string.h>

static bool is_same(const struct stat *a, const struct stat *b) {
    return a->st_dev == b->st_dev && a->st_ino == b->st_ino && a->st_size == b->st_size &&
           a->st_mtim.tv_sec == b->st_mtim.tv_sec && a->st_mtim.tv_nsec == b->st_mtim.tv_nsec;
}

static void read_grade(struct case_standing *s, const char *dir, uint64_t hash) {
    enum result result = grade_read(dir, &s->grade, &s->problem);
    if (result == RESULT_MISSING)
        s->kind = STANDING_UNCHECKED;
    else if (result != RESULT_OK)
        s->kind = STANDING_UNREADABLE;
    else if (s->grade.hash != hash)
        s->kind = STANDING_OUTDATED;
    else
        s->kind = s->grade.made_here || s->grade.grade == GRADE_UNFIT ? STANDING_GRADED
                                                                      : STANDING_FOREIGN;
}

bool standing_refresh(struct case_standing *standing, const char *dir, uint64_t hash) {
    char path[PATH_MAX];
    struct stat now;
    snprintf(path, sizeof path, "%s/%s", dir, GRADE_FILE);
    if (stat(path, &now))
        now = (struct stat){0};
    if (standing->looked && is_same(&now, &standing->file))
        return false;
    standing->looked = true;
    standing->file = now;
    read_grade(standing, dir, hash);
    return true;
}

const char *standing_name(const struct case_standing *standing) {
    return standing->kind == STANDING_GRADED ? grade_name(standing->grade.grade) : "not checked";
}
