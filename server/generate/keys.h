// Keys of torn ligaments, from where hands hold the joint.
#pragma once

#include "generate/pathology.h"

// Adds a torn ligament to a case that has its bones: the mock-up's tibia is held there, and the
// patient's goes further, both in contact as motion/joint.h has it, and clear of the menisci where
// there are some. RESULT_INVALID: it is torn already; RESULT_LIMIT: too many ligaments or keys;
// RESULT_MISSING: a bone is not there; nothing has changed then.
enum result keys_add(struct knee_case *knee, const char *name,
                     const struct pathology_ligament *ligament, struct error *err);
