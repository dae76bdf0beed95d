#include "check/bounds.h"

#include <math.h>
#include <stdio.h>

// Widths and heights: from three standard deviations below the smallest mean to three above the
// largest one. The faults are what no adult has.
static const struct bound bounds[BOUND_COUNT] = {
    [BOUND_CONDYLES] =
        {"the condyles' width", "mm", 45, 55, 101, 120,
         "64.5 ± 3.1 mm in Malay women (Hussain et al., BioMed Res Int 2013:175056) "
         "to 88.6 ± 4.2 mm in Greek men (Terzidis et al., Anat Res Int 2012:679658)"},
    [BOUND_PLATEAU] = {"the plateau's width", "mm", 45, 56, 102, 120,
                       "67.6 ± 3.1 mm in Korean women (Kwak et al., Knee 14:295-300, 2007) to "
                       "83.0 ± 6.2 mm in Japanese men (Uehara et al., J Arthroplasty 17:1028-1032, "
                       "2002)"},
    [BOUND_MENISCUS_VOLUME] = {"the volume", "cm3", 0.1, 0.5, 5, 10,
                               "half of the least to twice the largest of scanned and made knees, "
                               "0.97 to 2.4 cm3; a meniscus covers 50 to 58 % of its plateau "
                               "(Bloecker et al., BMC Musculoskelet Disord 12:248, 2011)"},
    [BOUND_PATELLA_HEIGHT] = {"the height", "mm", 15, 23, 60, 80,
                              "34.4 ± 3.8 mm (Iranpour et al., Clin Orthop Relat Res "
                              "466, 2008); 42 mm in Filipino men, and more with "
                              "cartilage"},
    [BOUND_PATELLA_WIDTH] = {"the width", "mm", 20, 30, 60, 80,
                             "44.8 ± 4.8 mm (Iranpour et al., Clin Orthop Relat Res "
                             "466, 2008)"},
    [BOUND_PATELLA_ASIDE] = {"the way from the middle of the condyles to that of the patella",
                             "of their width", -INFINITY, -INFINITY, 0.3, 0.5,
                             "beyond half of it the patella lies beside the trochlea: it is "
                             "dislocated (Dejour et al., Knee Surg Sports Traumatol Arthrosc "
                             "2:19-26, 1994)"},
    [BOUND_PATELLA_ABOVE] = {"the way from the plateau up to the patella", "of its height", -1,
                             -0.2, 1.6, 3,
                             "ratios of patellar height of 0.54 to 1.3 (Phillips et al., J Bone "
                             "Joint Surg Br 92:1045-1053, 2010), here from the lower pole"},
    [BOUND_ORIGIN] = {"the way from the origin to the joint", "mm", -INFINITY, -INFINITY, 500, 2000,
                      "the files' floats are off by up to 3e-5 mm from 0.5 m on, and by more than "
                      "1e-4 mm, what a touch may be off, from 2 m on"},
    [BOUND_BONES_OVERLAP] = {"the depth in the other bone", "mm", -INFINITY, -INFINITY, 0.5, 2,
                             "cartilage is 1.6 to 2.4 mm thick (Eckstein et al., Osteoarthritis "
                             "Cartilage 9:101-111, 2001): deeper, bone is in bone"},
    [BOUND_MENISCUS_OVERLAP] = {"the depth of meniscus and bone in each other", "mm", -INFINITY,
                                -INFINITY, 0.5, 4,
                                "with flexion menisci glide back by 5 mm medially and 11 mm "
                                "laterally (Thompson et al., Am J Sports Med 19:210-215, 1991); a "
                                "rigid one does not"},
    [BOUND_TIBIA_GAP] = {"the least gap", "mm", -INFINITY, -INFINITY, 8.1, 16,
                         "bones without cartilage are 5.7 ± 0.8 mm apart in men (Beattie et al., "
                         "BMC Musculoskelet Disord 9:119, 2008)"},
    [BOUND_PATELLA_GAP] = {"the least gap", "mm", -INFINITY, -INFINITY, 10, 20,
                           "the thickest cartilage is the patella's, 5.7 mm (Eckstein et al., "
                           "Osteoarthritis Cartilage 9:101-111, 2001), and the trochlea has some, "
                           "too"},
    [BOUND_MENISCUS_TIBIA_GAP] = {"the least gap", "mm", -INFINITY, -INFINITY, 3, 6,
                                  "a meniscus lies on the cartilage of the tibia, 1.6 to 2.4 mm "
                                  "thick (Eckstein et al., Osteoarthritis Cartilage 9:101-111, "
                                  "2001)"},
    [BOUND_MENISCUS_FEMUR_GAP] = {"the least gap", "mm", -INFINITY, -INFINITY, 6, 12,
                                  "a condyle lies in the meniscus, with cartilage of 1.6 to 2.4 mm "
                                  "between (Eckstein et al., Osteoarthritis Cartilage 9:101-111, "
                                  "2001)"},
};

const struct bound *bound_of(enum bound_id id) {
    return &bounds[id];
}

enum finding_level bound_level(enum bound_id id, double value) {
    const struct bound *b = &bounds[id];
    if (!(value >= b->fault_least && value <= b->fault_most))
        return FINDING_FAULT;
    return value >= b->least && value <= b->most ? FINDING_NOTE : FINDING_WARNING;
}

void bound_text(enum bound_id id, double value, char *out, size_t size) {
    const struct bound *b = &bounds[id];
    if (isinf(b->least))
        snprintf(out, size, "%s is %.3g %s, more than %g: %s", b->what, value, b->unit, b->most,
                 b->source);
    else
        snprintf(out, size, "%s is %.3g %s, beyond %g to %g: %s", b->what, value, b->unit, b->least,
                 b->most, b->source);
}

void bound_inspect(struct inspection *inspection, enum bound_id id, const char *where,
                   double value) {
    char text[384];
    enum finding_level level = bound_level(id, value);
    bound_text(id, value, text, sizeof text);
    if (level != FINDING_NOTE)
        inspection_note(inspection, level, where, "%s", text);
}
