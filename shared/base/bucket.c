#include "base/bucket.h"

#include "base/clock.h"

bool bucket_take(struct bucket *bucket, double per_s, double most, int64_t now_ns) {
    double back = per_s * (double)(now_ns - bucket->checked_ns) / (double)NS_PER_S;
    bucket->spent = back < bucket->spent ? bucket->spent - back : 0;
    bucket->checked_ns = now_ns;
    if (bucket->spent + 1 > most)
        return false;
    bucket->spent += 1;
    return true;
}
