// Keys of torn ligaments, from where hands hold the joint.
#pragma once

#include "generate/generate.h"

// Adds the recipe's torn ligaments to a case that has its bones: the mock-up's tibia is held there,
// and the patient's goes further, both in contact as motion/joint.h has it. RESULT_IO where
// there is no search structure.
enum result generate_keys(struct knee_case *knee, const struct recipe *recipe, struct error *err);
