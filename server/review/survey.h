// A summary of a trace, from one pass over it.
#pragma once

#include "trace/trace.h"

#define SURVEY_MARKERS_MAX 1024
#define SURVEY_ATTEMPTS_MAX 256

struct survey {
    uint64_t steps, gaps, missing; // step records, gap records, the steps those stand for
    uint64_t past, resumes;        // inputs alone; times that its server was started again
    uint64_t taken;                // jobs of the server before, and
    uint64_t state_step;           // the step of its state, from which a later part begins; else 0
    uint64_t faults;               // times that the disk failed
    uint64_t frames;               // steps whose input was a frame
    uint64_t lost_samples;         // samples that a station sent as lost
    uint64_t events[EVENT_COUNT];  // steps with EVENT_STATE, EVENT_DEVICE_LOST, ... in order
    uint64_t jobs;                 // that were asked for
    uint64_t touches, touch_bytes; // landed touched surfaces, and their bytes in the trace
    struct tissue_figures tissues[TISSUES_MAX]; // as the last job of each left them
    uint64_t present[INSTRUMENT_COUNT];
    struct noticing {
        uint64_t turn, tilt, gain, any; // steps past the threshold of step/discrepancy.h
        struct discrepancy worst;       // of each figure; gain_least: the least
        double penetration_mm;          // the largest
    } noticing[INSTRUMENT_COUNT];
    double share[ADAPTIVE_LIGAMENTS_MAX]; // the largest given of each torn ligament's extra motion
    int torn_count;
    int64_t first_ns, last_ns;          // time of the first and last step
    int64_t begun_utc_ns;               // about when the first step was made; 0: there is none
    int64_t until_utc_ns;               // and the last one before the session was closed
    int64_t written_utc_ns;             // about when the last record was written
    enum session_state state;           // after the last step
    double largest_mm;                  // displacement of any instrument
    uint32_t remark_count;              // the highest number
    struct remark remarks[REMARKS_MAX]; // by number - 1, as they were in the end; number 0: none
    uint64_t marker_count;              // of devices
    struct marker markers[SURVEY_MARKERS_MAX]; // the first of them, as they came
    uint64_t attempt_count;
    struct survey_attempt {
        struct trace_attempt begun;  // without its text
        struct trace_outcome ended;  // number 0: the trace has no end of it
    } attempts[SURVEY_ATTEMPTS_MAX]; // the first of them
    uint64_t whole_bytes;            // up to the end of the last whole record
    uint64_t file_bytes;
    enum result end;  // RESULT_CLOSED: the file is whole
    struct error why; // where it is not
};

// Called now and then with the bytes read so far and the size of the file.
typedef void (*survey_progress)(uint64_t done, uint64_t all);

// Reads all that can be read. progress: or NULL.
void survey_read(struct trace_reader *reader, survey_progress progress, struct survey *out_survey);

double survey_seconds(const struct survey *survey);
bool survey_is_resected(const struct survey *survey, int tissue); // or a cut of it was refused
uint64_t survey_attempts(const struct survey *survey);            // that are kept
