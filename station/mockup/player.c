#include "player.h"

#include "base/clock.h"

double player_seconds(const struct player *player, int64_t now_ns) {
    return (double)(now_ns - player->start_ns) / NS_PER_S;
}

double player_file_time(const struct player *player, double seconds) {
    const struct recording *r = &player->recording;
    return r->t_seconds[0] + fmod(fmax(0, seconds), recording_period(r));
}

int64_t player_row_ns(const struct player *player, int64_t round, int row) {
    const struct recording *r = &player->recording;
    double seconds = r->t_seconds[row] - r->t_seconds[0] + (double)round * recording_period(r);
    return player->start_ns + (int64_t)(seconds * NS_PER_S);
}

bool player_pulse(int64_t now_ns) {
    return now_ns % PLAYER_PULSE_NS < PLAYER_PULSE_NS / 2;
}
