#include "library_client.h"

#include <algorithm>
#include <cstring>
#include <deque>
#include <igtlClientSocket.h>
#include <igtlMessageHeader.h>
#include <igtlPolyDataMessage.h>
#include <igtlQuaternionTrackingDataMessage.h>
#include <igtlStatusMessage.h>
#include <igtlStringMessage.h>
#include <igtlTrackingDataMessage.h>
#include <igtlTransformMessage.h>
#include <igtl_util.h>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

static const size_t header_size = 58, version_at = 0, size_at = 42, crc_at = 50, extended_size = 12;

// For the leak sanitizer: the library does not free what it knows of a POLYDATA.
extern "C" const char *__lsan_default_suppressions();
extern "C" const char *__lsan_default_suppressions() {
    return "leak:igtl_polydata_alloc_info\n";
}

struct received {
    library_message message;
    std::vector<float> points;
    std::vector<uint32_t> triangles;
};

struct library_client {
    igtl::ClientSocket::Pointer socket;
    std::mutex lock;
    std::deque<received> all;
    std::thread thread;
};

using packet = std::vector<uint8_t>;

static uint64_t number_at(const uint8_t *bytes, size_t size) {
    uint64_t number = 0;
    for (size_t i = 0; i < size; i++)
        number = number << 8 | bytes[i];
    return number;
}

static void put_number(uint8_t *out, uint64_t number, size_t size) {
    for (size_t i = 0; i < size; i++)
        out[i] = (uint8_t)(number >> (8 * (size - 1 - i)));
}

static void close_packet(packet &p, int version) {
    size_t size = p.size() - header_size;
    put_number(&p[version_at], (uint64_t)version, 2);
    put_number(&p[size_at], size, 8);
    put_number(&p[crc_at], crc64(p.data() + header_size, size, 0), 8);
}

// ---- what comes ---------------------------------------------------------------------------------

// Leaves the content alone. False where the checksum or the lengths are wrong.
static bool strip(packet &p) {
    const uint8_t *body = p.data() + header_size;
    size_t size = p.size() - header_size;
    if (crc64(p.data() + header_size, size, 0) != number_at(&p[crc_at], 8))
        return false;
    if (number_at(&p[version_at], 2) < 2)
        return true;
    if (size < extended_size)
        return false;
    uint64_t extended = number_at(body, 2);
    uint64_t meta = number_at(body + 2, 2) + number_at(body + 4, 4);
    if (extended < extended_size || extended + meta > size)
        return false;
    p.resize(p.size() - meta);
    p.erase(p.begin() + header_size, p.begin() + (long)(header_size + extended));
    close_packet(p, 1);
    return true;
}

template <class Message> static typename Message::Pointer unpacked(const packet &p) {
    auto header = igtl::MessageHeader::New();
    header->InitPack();
    std::memcpy(header->GetPackPointer(), p.data(), header_size);
    header->Unpack();
    auto message = Message::New();
    message->SetMessageHeader(header);
    message->AllocatePack();
    if (p.size() > header_size)
        std::memcpy(message->GetPackBodyPointer(), p.data() + header_size, p.size() - header_size);
    return message->Unpack(1) & igtl::MessageHeader::UNPACK_BODY ? message
                                                                 : typename Message::Pointer();
}

static void copy(char *out, size_t room, const char *text) {
    size_t length = std::min(std::strlen(text), room - 1);
    std::memcpy(out, text, length);
    out[length] = 0;
}

static library_tool *add_tool(library_message &m, const char *name, int type) {
    library_tool *tool = &m.tools[m.tool_count < LIBRARY_TOOLS_MAX - 1 ? m.tool_count : 0];
    m.tool_count++;
    copy(tool->name, sizeof tool->name, name);
    tool->type = type;
    return tool;
}

static void put_matrix(library_tool *tool, igtl::Matrix4x4 &matrix) {
    for (int row = 0; row < 3; row++) {
        tool->position[row] = matrix[row][3];
        for (int column = 0; column < 3; column++)
            tool->matrix[row][column] = matrix[row][column];
    }
}

static bool read_transform(const packet &p, received &r) {
    auto message = unpacked<igtl::TransformMessage>(p);
    igtl::Matrix4x4 matrix;
    if (message.IsNull())
        return false;
    message->GetMatrix(matrix);
    put_matrix(add_tool(r.message, r.message.device, 0), matrix);
    return true;
}

static bool read_tdata(const packet &p, received &r) {
    auto message = unpacked<igtl::TrackingDataMessage>(p);
    if (message.IsNull())
        return false;
    for (int i = 0; i < message->GetNumberOfTrackingDataElements(); i++) {
        igtl::TrackingDataElement::Pointer element;
        igtl::Matrix4x4 matrix;
        message->GetTrackingDataElement(i, element);
        element->GetMatrix(matrix);
        put_matrix(add_tool(r.message, element->GetName(), element->GetType()), matrix);
    }
    return true;
}

static bool read_qtdata(const packet &p, received &r) {
    auto message = unpacked<igtl::QuaternionTrackingDataMessage>(p);
    if (message.IsNull())
        return false;
    for (int i = 0; i < message->GetNumberOfQuaternionTrackingDataElements(); i++) {
        igtl::QuaternionTrackingDataElement::Pointer element;
        message->GetQuaternionTrackingDataElement(i, element);
        library_tool *tool = add_tool(r.message, element->GetName(), element->GetType());
        element->GetPosition(tool->position);
        element->GetQuaternion(tool->quaternion);
    }
    return true;
}

static bool read_string(const packet &p, received &r) {
    auto message = unpacked<igtl::StringMessage>(p);
    if (message.IsNull())
        return false;
    copy(r.message.text, sizeof r.message.text, message->GetString());
    return true;
}

static bool read_status(const packet &p, received &r) {
    auto message = unpacked<igtl::StatusMessage>(p);
    if (message.IsNull())
        return false;
    r.message.status = message->GetCode();
    copy(r.message.text, sizeof r.message.text, message->GetStatusString());
    return true;
}

static bool read_polydata(const packet &p, received &r) {
    auto message = unpacked<igtl::PolyDataMessage>(p);
    if (message.IsNull())
        return false;
    igtl::PolyDataPointArray::Pointer points = message->GetPoints();
    igtl::PolyDataCellArray::Pointer polygons = message->GetPolygons();
    for (int i = 0; points.IsNotNull() && i < points->GetNumberOfPoints(); i++) {
        igtlFloat32 point[3];
        points->GetPoint((unsigned)i, point);
        r.points.insert(r.points.end(), point, point + 3);
    }
    for (unsigned i = 0; polygons.IsNotNull() && i < polygons->GetNumberOfCells(); i++) {
        igtlUint32 cell[3];
        if (polygons->GetCellSize(i) != 3)
            return false;
        polygons->GetCell(i, cell);
        r.triangles.insert(r.triangles.end(), cell, cell + 3);
    }
    r.message.point_count = (int)(r.points.size() / 3);
    r.message.triangle_count = (int)(r.triangles.size() / 3);
    return true;
}

static bool read_answer(const packet &p, received &r) {
    r.message.status = p.size() > header_size ? p[header_size] : 0;
    return p.size() == header_size + 1;
}

static bool read_content(const packet &p, received &r) {
    static const struct {
        const char *type;
        bool (*read)(const packet &p, received &r);
    } types[] = {{"TRANSFORM", read_transform}, {"TDATA", read_tdata},
                 {"QTDATA", read_qtdata},       {"STRING", read_string},
                 {"STATUS", read_status},       {"POLYDATA", read_polydata},
                 {"RTS_TDATA", read_answer},    {"RTS_QTDATA", read_answer}};
    for (const auto &one : types)
        if (!std::strcmp(r.message.type, one.type))
            return one.read(p, r);
    return false;
}

static void take(library_client *c, packet &p) {
    received r{};
    auto header = igtl::MessageHeader::New();
    unsigned seconds, fraction; // the library's own conversion is off by up to 16 ns
    r.message.version = (int)number_at(&p[version_at], 2);
    header->InitPack();
    std::memcpy(header->GetPackPointer(), p.data(), header_size);
    put_number(static_cast<uint8_t *>(header->GetPackPointer()), 1, 2); // it reads no other
    header->Unpack();
    header->GetTimeStamp(&seconds, &fraction);
    r.message.stamp_ns =
        (int64_t)seconds * 1000000000 + (int64_t)(((uint64_t)fraction * 1000000000) >> 32);
    copy(r.message.type, sizeof r.message.type, header->GetDeviceType());
    copy(r.message.device, sizeof r.message.device, header->GetDeviceName());
    r.message.read = strip(p) && read_content(p, r);
    std::lock_guard<std::mutex> guard(c->lock);
    c->all.push_back(std::move(r));
    received &kept = c->all.back();
    kept.message.points = kept.points.data();
    kept.message.triangles = kept.triangles.data();
}

static void run(library_client *c) {
    for (;;) {
        packet p(header_size);
        if (c->socket->Receive(p.data(), (int)header_size) != (int)header_size)
            return;
        size_t size = number_at(&p[size_at], 8);
        p.resize(header_size + size);
        if (size && c->socket->Receive(p.data() + header_size, (int)size) != (int)size)
            return;
        take(c, p);
    }
}

// ---- what goes ----------------------------------------------------------------------------------

static packet request(const char *type, const char *device, int interval_ms) {
    packet p(header_size);
    put_number(&p[version_at], 1, 2);
    std::memcpy(&p[2], type, std::strlen(type)); // without an end where it has 12 letters
    std::memcpy(&p[14], device, std::strlen(device));
    if (interval_ms) {
        bool quaternions = !std::strcmp(type, "STT_QTDATA");
        auto tdata = igtl::StartTrackingDataMessage::New();
        auto qtdata = igtl::StartQuaternionTrackingDataMessage::New();
        igtl::MessageBase *start = tdata.GetPointer();
        if (quaternions)
            start = qtdata.GetPointer();
        tdata->SetResolution(interval_ms);
        qtdata->SetResolution(interval_ms);
        tdata->SetCoordinateName("Patient");
        qtdata->SetCoordinateName("Patient");
        start->SetDeviceName(device);
        start->Pack();
        const auto *bytes = static_cast<const uint8_t *>(start->GetPackPointer());
        p.assign(bytes, bytes + start->GetPackSize());
    }
    return p;
}

bool library_client_ask(library_client *c, int version, const char *type, const char *device,
                        int interval_ms) {
    packet p = request(type, device, interval_ms);
    if (version > 1) {
        const uint8_t extended[extended_size] = {0, extended_size};
        p.insert(p.begin() + header_size, extended, extended + extended_size);
    }
    close_packet(p, version);
    return c->socket->Send(p.data(), (int)p.size()) != 0;
}

library_client *library_client_start_deaf(int port) {
    auto *c = new library_client;
    c->socket = igtl::ClientSocket::New();
    if (c->socket->ConnectToServer("127.0.0.1", port) != 0) {
        delete c;
        return nullptr;
    }
    return c;
}

library_client *library_client_start(int port) {
    library_client *c = library_client_start_deaf(port);
    if (c)
        c->thread = std::thread(run, c);
    return c;
}

void library_client_wait(library_client *c) {
    if (c->thread.joinable())
        c->thread.join();
}

void library_client_end(library_client *c) {
    library_client_wait(c);
    c->socket->CloseSocket();
    delete c;
}

int library_client_count(library_client *c) {
    std::lock_guard<std::mutex> guard(c->lock);
    return (int)c->all.size();
}

library_message library_client_message(library_client *c, int i) {
    std::lock_guard<std::mutex> guard(c->lock);
    return c->all[(size_t)i].message;
}
