#include "library_sensor.h"

#include <cstring>
#include <igtlSensorMessage.h>
#include <igtlStringMessage.h>
#include <igtlTimeStamp.h>

size_t library_sensor(const char *device, uint64_t unit, const double *values, int count,
                      uint8_t *out, size_t size) {
    auto message = igtl::SensorMessage::New();
    message->SetDeviceName(device);
    message->SetLength(static_cast<unsigned int>(count));
    message->SetUnit(unit);
    for (int i = 0; i < count; i++)
        message->SetValue(static_cast<unsigned int>(i), values[i]);
    message->Pack();
    size_t used = static_cast<size_t>(message->GetPackSize());
    if (used > size)
        return 0;
    std::memcpy(out, message->GetPackPointer(), used);
    return used;
}

size_t library_string(const char *device, double utc_s, const char *text, uint8_t *out,
                      size_t size) {
    auto message = igtl::StringMessage::New();
    auto stamp = igtl::TimeStamp::New();
    stamp->SetTime(utc_s);
    message->SetDeviceName(device);
    message->SetTimeStamp(stamp);
    message->SetString(text);
    message->Pack();
    size_t used = static_cast<size_t>(message->GetPackSize());
    if (used > size)
        return 0;
    std::memcpy(out, message->GetPackPointer(), used);
    return used;
}
