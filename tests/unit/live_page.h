// A page that looks on, for tests: it draws batches, counts what it is told, and keeps its mesh.
#pragma once

#include "live/live.h"
#include "unit/hall.h"

extern const struct live_account instructor, technician, trainee;

struct page {
    struct live_server *live;
    struct viewer *viewer;
    bool meshes; // asks for them, and acknowledges
    int batches, moments, places, sessions, resections, remarks, replies, metrics, troubles;
    int progresses, beats;
    arthron_Trouble_Kind trouble_kind; // of the last
    bool done;
    uint64_t last_step;
    bool fell; // a step or a time did
    int64_t last_ns;
    arthron_LiveSession session;
    arthron_Resection resection; // the last
    arthron_Place place;         // the last
    arthron_Remark remark;       // the last
    int markers;
    arthron_Marker marker;      // the last
    arthron_CommandReply reply; // the last
    char trouble[256];          // the last
    double time_s;              // that the session ran, by the last metrics
    struct tissue tissue;
    uint8_t *payload;
    size_t payload_size;
    int payloads;
};

struct live_server *open_live(struct sessions *sessions); // instructors may play what is recorded

void open_page(struct page *page, struct live_server *live, const struct live_account *account);
void close_page(struct page *page);
void say(struct page *page, const arthron_Page *message);
void watch(struct page *page, arthron_Watch_What what, const char *name, uint32_t rate_hz);
void ask_for_meshes(struct page *page);
void command(struct page *page, arthron_Command_Kind kind, const char *text); // about room-1
void copy(struct page *page, const char *from);

// One batch, if there is one now. Returns what it was asked to wait for.
int64_t draw_at(struct page *page, int64_t now_ns);
int64_t draw(struct page *page);
void draw_for(struct page *page, long ms); // whatever there is for so long
void draw_until(struct page *page, const int *count, int least);
void draw_until_shown(struct page *page, const struct tissue_report *report);
