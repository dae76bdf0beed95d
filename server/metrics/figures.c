#include "metrics/metrics.h"

// Above these the tests and the bench `metrics` see a change of under a tenth.
#define PATH_LEAST_MM 10.0
#define ECONOMY_LEAST_MM 50.0
#define LDLJ_LEAST_OVER_NOISE 2.3 // noise makes it 9 % more
#define MOTION_LEAST_HZ 20.0
#define PRESENT_LEAST_HZ 10.0
#define COVERED_LEAST 0.9
#define SHARE_LEAST 0.05
#define CONTACT_LEAST_S 5.0
#define DEPTH_LEAST_MM 0.2
#define TIME_LEAST_S 1.0

static const char no_floor[] = "";
static const char present_floor[] = "10 samples/s";
static const char path_floor[] = "10 mm; 20 samples/s over 90 % of the time present";
static const char economy_floor[] = "a path of 50 mm; 20 samples/s over 90 % of the time present";
static const char force_floor[] = "1 s of measured force";
static const char ldlj_floor[] =
    "600 mm/s3 of jerk at 100 samples/s, more at fewer; 20 samples/s over 90 % of the time present";

const struct metric_kind metric_kinds[METRIC_COUNT] = {
    [METRIC_TIME] = {"time", "s", 1, true, no_floor},
    [METRIC_PRESENT] = {"present", "s", 1, true, present_floor},
    [METRIC_PATH_HAND] = {"path_hand", "mm", 1, true, path_floor},
    [METRIC_PATH_SEEN] = {"path_seen", "mm", 1, true, path_floor},
    [METRIC_ECONOMY_HAND] = {"economy_hand", "1", 1, true, economy_floor},
    [METRIC_ECONOMY_SEEN] = {"economy_seen", "1", 1, true, economy_floor},
    [METRIC_LDLJ_HAND] = {"ldlj_hand", "1", 1, true, ldlj_floor},
    [METRIC_LDLJ_SEEN] = {"ldlj_seen", "1", 1, true, ldlj_floor},
    [METRIC_CONTACTS] = {"contacts", "count", 1, false, no_floor},
    [METRIC_CONTACT_TIME] = {"contact_time", "s", 1, true, "5 s"},
    [METRIC_DEPTH_TIME] = {"depth_time", "s", 1, false, no_floor},
    [METRIC_DEPTH_MAX] = {"depth_max", "mm", 1, false, "0.2 mm"},
    [METRIC_FORCE_MEAN] = {"force_mean", "N", 1, false, force_floor},
    [METRIC_FORCE_PEAK] = {"force_peak", "N", 1, false, no_floor},
    [METRIC_FORCE_OK] = {"force_ok", "1", 1, false, no_floor},
    [METRIC_FORCE_HELD] = {"force_held", "1", 1, false, no_floor},
    [METRIC_FORCE_LOST] = {"force_lost", "1", 1, false, no_floor},
    [METRIC_FORCE_FREE_MEAN] = {"force_free_mean", "N", 1, false, force_floor},
    [METRIC_FORCE_FREE_PEAK] = {"force_free_peak", "N", 1, false, no_floor},
    [METRIC_OUT_OF_VIEW] = {"out_of_view", "s", 1, true, "1 s; 10 samples/s"},
    [METRIC_OUT_OF_VIEW_SHARE] = {"out_of_view_share", "1", 1, true, "0.05"},
    [METRIC_TRIANGULATIONS] = {"triangulations", "count", 1, false, no_floor},
    [METRIC_TRIANGULATION_FIRST] = {"triangulation_first", "s", 1, false, no_floor},
    [METRIC_TRIANGULATION_MEAN] = {"triangulation_mean", "s", 1, false, no_floor},
    [METRIC_BIMANUAL] = {"bimanual", "1", 1, true, "0.05, of 1 s of motion; 20 samples/s"},
    [METRIC_NOTICED_TURN] = {"noticed_turn", "1", 2, true, "0.05"},
    [METRIC_NOTICED_TILT] = {"noticed_tilt", "1", 2, true, "0.05"},
    [METRIC_NOTICED_GAIN] = {"noticed_gain", "1", 2, true, "0.05"},
    [METRIC_NOTICED_ANY] = {"noticed_any", "1", 2, true, "0.05"},
    [METRIC_BONE_FORCE_PEAK] = {"bone_force_peak", "N", 1, false, no_floor},
    [METRIC_BONE_FORCE_OK] = {"bone_force_ok", "1", 1, false, no_floor},
    [METRIC_CUTS] = {"cuts", "count", 1, false, no_floor},
    [METRIC_CUTS_REFUSED] = {"cuts_refused", "count", 1, false, no_floor},
    [METRIC_CUTS_UNDONE] = {"cuts_undone", "count", 1, false, no_floor},
    [METRIC_REMOVED] = {"removed", "mm3", 1, false, no_floor},
    [METRIC_PLANNED] = {"planned", "mm3", 1, false, no_floor},
    [METRIC_OVER] = {"over", "mm3", 1, false, no_floor},
    [METRIC_UNDER] = {"under", "mm3", 1, false, no_floor},
    [METRIC_DAMAGE_LEFT] = {"damage_left", "mm3", 1, false, no_floor},
    [METRIC_RIM] = {"rim", "mm", 1, false, no_floor},
    [METRIC_RIM_STEP] = {"rim_step", "mm", 1, false, no_floor},
    [METRIC_ZONE_WHOLE] = {"zone_whole", "mm3", 1, false, no_floor},
    [METRIC_ZONE_REMOVED] = {"zone_removed", "mm3", 1, false, no_floor},
};

struct metric_list {
    void (*each)(void *, const struct metric_value *);
    void *context;
    const struct metrics *m;
    const struct knee_case *knee;
    struct metric_value about; // whom the next figures are about
};

static void tell(struct metric_list *t, enum metric metric, double value, bool above_floor) {
    struct metric_value v = t->about;
    v.metric = metric;
    v.value = value;
    v.below_floor = !above_floor;
    t->each(t->context, &v);
}

static double seconds(int64_t ns) {
    return 1e-9 * (double)ns;
}

static double share_of(int64_t part_ns, int64_t all_ns) {
    return all_ns ? (double)part_ns / (double)all_ns : NAN;
}

// ---- one instrument -----------------------------------------------------------------------------

static bool is_followed(const struct instrument_metrics *one) {
    double present_s = seconds(one->present_ns);
    return (double)one->hand.jerks >= COVERED_LEAST * present_s * SMOOTH_RATE_HZ &&
           (double)one->samples >= MOTION_LEAST_HZ * present_s;
}

static bool is_well_present(const struct instrument_metrics *one) {
    return (double)one->samples >= PRESENT_LEAST_HZ * seconds(one->present_ns);
}

static bool is_over_noise(const struct instrument_metrics *one, const struct travel *travel) {
    double rate_hz = (double)one->samples / seconds(one->present_ns);
    return travel_jerk(travel) >= LDLJ_LEAST_OVER_NOISE * travel_noise_jerk(rate_hz);
}

static void tell_travel(struct metric_list *t, const struct instrument_metrics *one, bool seen) {
    const struct travel *travel = seen ? &one->seen : &one->hand;
    bool followed = is_followed(one);
    double path = travel_path_mm(travel);
    tell(t, METRIC_PATH_HAND + seen, path, followed && path >= PATH_LEAST_MM);
    tell(t, METRIC_ECONOMY_HAND + seen, travel_economy(travel),
         followed && path >= ECONOMY_LEAST_MM);
    tell(t, METRIC_LDLJ_HAND + seen, travel_ldlj(travel), followed && is_over_noise(one, travel));
}

static void tell_touch(struct metric_list *t, const struct touch *touch) {
    for (int g = 0; g < CASE_GROUPS_MAX; g++) {
        const struct group_touch *group = &touch->groups[g];
        t->about.group = g;
        if (!group->count && group->deepest_mm < touch_depth_mm[0])
            continue;
        tell(t, METRIC_CONTACTS, group->count, true);
        tell(t, METRIC_CONTACT_TIME, seconds(group->touching_ns),
             group->touching_ns >= CONTACT_LEAST_S * 1e9);
        for (t->about.depth = 0; t->about.depth < TOUCH_DEPTHS; t->about.depth++)
            tell(t, METRIC_DEPTH_TIME, seconds(group->deep_ns[t->about.depth]), true);
        t->about.depth = -1;
        tell(t, METRIC_DEPTH_MAX, group->deepest_mm, group->deepest_mm >= DEPTH_LEAST_MM);
    }
    t->about.group = -1;
}

static void tell_forces(struct metric_list *t, enum metric mean, enum metric peak,
                        const struct force_figures *f) {
    tell(t, mean, force_mean_n(f), seconds(f->in_ns[VALIDITY_OK]) >= TIME_LEAST_S);
    tell(t, peak, force_peak_n(f), true);
}

static void tell_force(struct metric_list *t, const struct instrument_metrics *one) {
    if (!one->gauge.known)
        return;
    for (int g = 0; g < CASE_GROUPS_MAX; g++) {
        const struct force_figures *f = &one->pressed[g];
        t->about.group = g;
        if (!force_time_ns(f))
            continue;
        tell_forces(t, METRIC_FORCE_MEAN, METRIC_FORCE_PEAK, f);
        for (int i = 0; i < VALIDITY_COUNT; i++)
            tell(t, METRIC_FORCE_OK + (enum metric)i, share_of(f->in_ns[i], force_time_ns(f)),
                 true);
    }
    t->about.group = -1;
    tell_forces(t, METRIC_FORCE_FREE_MEAN, METRIC_FORCE_FREE_PEAK, &one->free);
}

static void tell_share(struct metric_list *t, enum metric metric, int64_t part_ns, int64_t all_ns) {
    double share = share_of(part_ns, all_ns);
    tell(t, metric, share, share >= SHARE_LEAST && seconds(all_ns) >= TIME_LEAST_S);
}

static void tell_view(struct metric_list *t, const struct instrument_metrics *one) {
    if (!one->beside_scope_ns)
        return;
    double out_s = seconds(one->out_of_view_ns);
    tell(t, METRIC_OUT_OF_VIEW, out_s, out_s >= TIME_LEAST_S && is_well_present(one));
    tell_share(t, METRIC_OUT_OF_VIEW_SHARE, one->out_of_view_ns, one->beside_scope_ns);
    tell(t, METRIC_TRIANGULATIONS, one->search.found, true);
    tell(t, METRIC_TRIANGULATION_FIRST, search_first_s(&one->search), true);
    tell(t, METRIC_TRIANGULATION_MEAN, search_mean_s(&one->search), true);
}

static void tell_instrument(struct metric_list *t, const struct instrument_metrics *one) {
    if (!one->present_ns)
        return;
    tell(t, METRIC_PRESENT, seconds(one->present_ns), is_well_present(one));
    tell_travel(t, one, false);
    tell_travel(t, one, true);
    tell_touch(t, &one->touch);
    tell_force(t, one);
    tell_view(t, one);
    for (int i = 0; i < NOTICED_COUNT; i++)
        tell_share(t, METRIC_NOTICED_TURN + (enum metric)i, one->noticed_ns[i], one->judged_ns);
}

// ---- one bone -----------------------------------------------------------------------------------

static void tell_bone(struct metric_list *t, const struct bone_metrics *bone) {
    if (!bone->gauge.known)
        return;
    const struct force_figures *f = &bone->pressed;
    tell(t, METRIC_BONE_FORCE_PEAK, force_peak_n(f), true);
    tell(t, METRIC_BONE_FORCE_OK, share_of(f->in_ns[VALIDITY_OK], force_time_ns(f)), true);
}

// ---- one tissue ---------------------------------------------------------------------------------

static void tell_zones(struct metric_list *t, const struct quality_report *q) {
    for (int a = 0; a < ZONE_ALONG_COUNT; a++)
        for (int c = 0; c < ZONE_ACROSS_COUNT; c++) {
            t->about.along = a;
            t->about.across = c;
            tell(t, METRIC_ZONE_WHOLE, q->whole.mm3[a][c], true);
            tell(t, METRIC_ZONE_REMOVED, q->removed.mm3[a][c], true);
        }
    t->about.along = t->about.across = -1;
}

bool metrics_has_zones(const struct knee_case *knee, int tissue) {
    for (int i = 0, at = 0; knee && i < knee->group_count; i++)
        if (knee->groups[i].cuttable && at++ == tissue)
            return knee->groups[i].tissue.has_zones;
    return true;
}

static void tell_tissue(struct metric_list *t, const struct tissue_figures *f, uint32_t undone) {
    const struct quality_report *q = &f->quality;
    tell(t, METRIC_CUTS, f->cuts, true);
    tell(t, METRIC_CUTS_REFUSED, f->refused, true);
    tell(t, METRIC_CUTS_UNDONE, undone, true);
    tell(t, METRIC_REMOVED, q->removed_mm3, true);
    tell(t, METRIC_PLANNED, q->planned_mm3, true);
    tell(t, METRIC_OVER, q->over_mm3, true);
    tell(t, METRIC_UNDER, q->under_mm3, true);
    tell(t, METRIC_DAMAGE_LEFT, q->damage_mm3, true);
    if (!metrics_has_zones(t->knee, t->about.tissue))
        return;
    tell(t, METRIC_RIM, q->rim_mm, true);
    tell(t, METRIC_RIM_STEP, q->step_mm, true);
    tell_zones(t, q);
}

static void tell_hands(struct metric_list *t) {
    double share = hands_together(&t->m->hands);
    bool followed = hands_seconds(&t->m->hands) >= TIME_LEAST_S;
    for (int i = 0; i < INSTRUMENT_COUNT; i++)
        followed = followed && is_followed(&t->m->instruments[i]);
    tell(t, METRIC_BIMANUAL, share, followed && share >= SHARE_LEAST);
}

void metrics_each(const struct metrics *m, const struct knee_case *knee,
                  void (*each)(void *, const struct metric_value *), void *context) {
    struct metric_value nobody = {METRIC_TIME, -1, -1, -1, -1, -1, -1, NULL, NAN, false};
    struct metric_list t = {each, context, m, knee, nobody};
    tell(&t, METRIC_TIME, seconds(m->running_ns), true);
    tell_hands(&t);
    for (int i = 0; i < m->tools.count; i++) {
        t.about.instrument = i;
        t.about.owner = m->tools.of[i].name;
        tell_instrument(&t, &m->instruments[i]);
    }
    t.about.instrument = -1;
    for (int i = 0; i < BODY_COUNT; i++) {
        t.about.owner = channel_name(CHANNEL_FEMUR + (enum channel)i);
        tell_bone(&t, &m->bones[i]);
    }
    t.about.owner = NULL;
    for (int i = 0; i < TISSUES_MAX; i++) {
        t.about.tissue = i;
        if (m->resected[i])
            tell_tissue(&t, &m->tissues[i], m->undone[i]);
    }
}
