// An instrument handle as a HID device, made through the kernel's /dev/uhid: to programs it is as
// real as one on a USB port. Its reports are described in README.md.
#pragma once

#include "base/result.h"

#include <stddef.h>
#include <stdint.h>

#define HANDLE_VID 0x1209
#define HANDLE_PID 0x0001
#define HANDLE_REPORT_BYTES 4

// Plugs in a handle with that serial number into that port, as the kernel would call it
// ("usb-0000:00:14.0-2/input0"; each at most 63 bytes). RESULT_MISSING: the kernel has no
// /dev/uhid (modprobe uhid); RESULT_IO: it refused, most often because we are not root.
enum result handle_plug(const char *serial, const char *port, int *out_handle, struct error *err);

void handle_report(double opening, uint8_t buttons, uint8_t out[HANDLE_REPORT_BYTES]);

enum result handle_send(int handle, const uint8_t *bytes, size_t size, struct error *err);

// What was sent right before may be lost, as it may be with a plug that is pulled.
void handle_unplug(int handle);
