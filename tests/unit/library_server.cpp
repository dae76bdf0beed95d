#include "library_server.h"

#include <atomic>
#include <cstring>
#include <igtlMessageHeader.h>
#include <igtlQuaternionTrackingDataMessage.h>
#include <igtlServerSocket.h>
#include <igtlStatusMessage.h>
#include <igtlTimeStamp.h>
#include <igtlTrackingDataMessage.h>
#include <igtlTransformMessage.h>
#include <mutex>
#include <string>
#include <thread>

struct library_server {
    library_server_kind kind;
    igtl::ServerSocket::Pointer listener;
    std::atomic<bool> stop{false};
    std::mutex lock;
    library_server_record record{};
    bool asked = false;
    float tool_x = 12; // moves a little, as a hand does
    std::thread thread;
};

static void send_status(igtl::Socket *socket, bool quaternions, bool granted) {
    if (quaternions) {
        auto answer = igtl::RTSQuaternionTrackingDataMessage::New();
        answer->SetStatus(granted ? 0 : 1);
        answer->Pack();
        socket->Send(answer->GetPackPointer(), answer->GetPackSize());
    } else {
        auto answer = igtl::RTSTrackingDataMessage::New();
        answer->SetStatus(granted ? 0 : 1);
        answer->Pack();
        socket->Send(answer->GetPackPointer(), answer->GetPackSize());
    }
}

template <class Start>
static void take_start(library_server *s, igtl::Socket *socket, igtl::MessageHeader *header,
                       bool quaternions) {
    auto start = Start::New();
    start->SetMessageHeader(header);
    start->AllocatePack();
    socket->Receive(start->GetPackBodyPointer(), start->GetPackBodySize());
    if (!(start->Unpack(1) & igtl::MessageHeader::UNPACK_BODY))
        return;
    bool has_tdata = s->kind == SENDS_TDATA || s->kind == HAS_TWO_DEVICES;
    bool granted = quaternions ? s->kind == SENDS_QTDATA : has_tdata;
    std::lock_guard<std::mutex> guard(s->lock);
    s->record.requests++;
    s->record.interval_ms = start->GetResolution();
    std::strncpy(s->record.coordinates, start->GetCoordinateName(), 32);
    std::strncpy(s->record.device, header->GetDeviceName(), 20);
    s->asked |= granted;
    send_status(socket, quaternions, granted);
}

static bool send_transform(library_server *s, igtl::Socket *socket);
static bool send_state(library_server *s, igtl::Socket *socket);

static void take_get(library_server *s, igtl::Socket *socket, igtl::MessageHeader *header) {
    socket->Skip(header->GetBodySizeToRead(), 0);
    if (s->kind != ANSWERS_GET || std::strcmp(header->GetDeviceName(), "pointer") != 0)
        return;
    {
        std::lock_guard<std::mutex> guard(s->lock);
        if (++s->record.gets % 5 == 0)
            return;
    }
    s->tool_x = s->tool_x < 13 ? s->tool_x + 0.002F : 12;
    send_transform(s, socket);
}

// False: the client has gone.
static bool hear(library_server *s, igtl::Socket *socket) {
    auto header = igtl::MessageHeader::New();
    header->InitPack();
    int size = socket->Receive(header->GetPackPointer(), header->GetPackSize());
    if (size <= 0)
        return size < 0; // a timeout
    header->Unpack();
    if (!std::strcmp(header->GetDeviceType(), "STT_TDATA"))
        take_start<igtl::StartTrackingDataMessage>(s, socket, header, false);
    else if (!std::strcmp(header->GetDeviceType(), "STT_QTDATA"))
        take_start<igtl::StartQuaternionTrackingDataMessage>(s, socket, header, true);
    else if (!std::strcmp(header->GetDeviceType(), "GET_TRANS"))
        take_get(s, socket, header);
    else
        socket->Skip(header->GetBodySizeToRead(), 0);
    if (!std::strcmp(header->GetDeviceType(), "GET_STATUS") && s->kind == SENDS_STATUS)
        return send_state(s, socket);
    return true;
}

// The library leaves the stamp of a message that is not stamped as it finds it in its memory.
static bool send(const library_server *s, igtl::Socket *socket, igtl::MessageBase *message) {
    const unsigned char ninth[] = {0, 9};
    auto now = igtl::TimeStamp::New();
    now->GetTime();
    if (s->kind == SENDS_ONE_STAMP || s->kind == REPEATS_ITSELF)
        message->SetTimeStamp(0xbebebebe, 0xbebebebe);
    else
        message->SetTimeStamp(now);
    message->Pack();
    if (s->kind == SENDS_VERSION_9)
        std::memcpy(message->GetPackPointer(), ninth, sizeof ninth);
    return socket->Send(message->GetPackPointer(), message->GetPackSize()) != 0;
}

static bool send_state(library_server *s, igtl::Socket *socket) {
    auto state = igtl::StatusMessage::New();
    {
        std::lock_guard<std::mutex> guard(s->lock);
        s->record.statuses++;
    }
    state->SetDeviceName("Tracker");
    state->SetCode(igtl::StatusMessage::STATUS_NOT_READY);
    state->SetErrorName("Warming up");
    state->SetStatusString("the lamps are cold");
    return send(s, socket, state);
}

static void put_tool(const library_server *s, igtl::Matrix4x4 &matrix) {
    igtl::IdentityMatrix(matrix);
    matrix[0][3] = s->tool_x;
}

static bool send_tdata(const library_server *s, igtl::Socket *socket,
                       const char *device = "Tracker", float off = 0) {
    auto message = igtl::TrackingDataMessage::New();
    auto tool = igtl::TrackingDataElement::New();
    igtl::Matrix4x4 matrix;
    put_tool(s, matrix);
    matrix[0][3] += off;
    tool->SetName("pointer");
    tool->SetType(igtl::TrackingDataElement::TYPE_6D);
    tool->SetMatrix(matrix);
    message->SetDeviceName(device);
    message->AddTrackingDataElement(tool);
    return send(s, socket, message);
}

static bool send_qtdata(const library_server *s, igtl::Socket *socket) {
    auto message = igtl::QuaternionTrackingDataMessage::New();
    auto tool = igtl::QuaternionTrackingDataElement::New();
    tool->SetName("pointer");
    tool->SetType(igtl::QuaternionTrackingDataElement::TYPE_6D);
    tool->SetPosition(s->tool_x, 0, 0);
    tool->SetQuaternion(0, 0, 0, 1);
    message->SetDeviceName("Tracker");
    message->AddQuaternionTrackingDataElement(tool);
    return send(s, socket, message);
}

static bool send_transform(library_server *s, igtl::Socket *socket) {
    auto message = igtl::TransformMessage::New();
    igtl::Matrix4x4 matrix;
    put_tool(s, matrix);
    message->SetDeviceName("pointer");
    message->SetMatrix(matrix);
    return send(s, socket, message);
}

static bool send_pose(library_server *s, igtl::Socket *socket) {
    if (s->kind != REPEATS_ITSELF)
        s->tool_x = s->tool_x < 13 ? s->tool_x + 0.002F : 12;
    switch (s->kind) {
    case SENDS_BY_ITSELF:
    case SENDS_ONE_STAMP:
    case REPEATS_ITSELF:
        return send_transform(s, socket);
    case SENDS_VERSION_9:
        return send_transform(s, socket);
    case HAS_TWO_DEVICES:
        return !s->asked || (send_tdata(s, socket) && send_tdata(s, socket, "Other", 100));
    case SENDS_TDATA:
        return !s->asked || send_tdata(s, socket);
    case SENDS_QTDATA:
        return !s->asked || send_qtdata(s, socket);
    default:
        return true;
    }
}

static void serve(library_server *s, igtl::Socket *socket) {
    socket->SetReceiveTimeout(5);
    while (!s->stop && hear(s, socket))
        if (!send_pose(s, socket))
            return;
}

static void run(library_server *s) {
    while (!s->stop) {
        igtl::ClientSocket::Pointer socket = s->listener->WaitForConnection(50);
        if (socket.IsNull())
            continue;
        s->asked = false;
        serve(s, socket);
        socket->CloseSocket();
    }
}

library_server *library_server_start(library_server_kind kind, int *out_port) {
    auto *s = new library_server;
    s->kind = kind;
    s->listener = igtl::ServerSocket::New();
    if (s->listener->CreateServer(0) < 0) {
        delete s;
        return nullptr;
    }
    *out_port = s->listener->GetServerPort();
    s->thread = std::thread(run, s);
    return s;
}

library_server_record library_server_told(library_server *s) {
    std::lock_guard<std::mutex> guard(s->lock);
    return s->record;
}

void library_server_stop(library_server *s) {
    s->stop = true;
    s->thread.join();
    s->listener->CloseSocket();
    delete s;
}
