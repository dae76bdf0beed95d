// The grade of a case: check.json in its folder, bound to the case's files by their hash. Reading
// it needs no check. A check that came with the case from elsewhere could say anything. So the
// folder around the case's has a file of the checks that were made here, each with the case's hash.
#pragma once

#include "base/result.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define GRADE_FILE "check.json"
#define GRADE_MADE_HERE ".checked" // beside the case's folder
#define GRADE_FORMAT "arthron-check"
#define GRADE_VERSION 1
#define GRADE_TEXT_MAX 384

enum grade { GRADE_FIT, GRADE_WARNINGS, GRADE_UNFIT, GRADE_COUNT };

const char *grade_name(enum grade grade); // "fit", "fit with warnings", "unfit"

struct case_grade {
    enum grade grade;
    uint64_t hash;               // of the case that was checked
    bool made_here;              // else only GRADE_UNFIT counts
    bool quick;                  // on a coarse grid, at few poses
    char field[32];              // name of the field that it was checked with
    char reason[GRADE_TEXT_MAX]; // the first fault, "where: text"; empty where there is none
};

// RESULT_MISSING where there is no check.json; RESULT_FORMAT, LIMIT, VERSION, INVALID where it is
// not one of ours, naming file and key. A refused file has no effect.
// So is a list of checks made here that cannot be read: none of them was.
enum result grade_read(const char *dir, struct case_grade *out_grade, struct error *err);

// Notes that this text of a check.json was made here, for the case of this hash in this folder.
enum result grade_note(const char *dir, uint64_t hash, const char *text, size_t size, int64_t utc_s,
                       struct error *err);
