// Poses as clients of OpenIGTLink's own classes get them, beside those that were to be sent: equal
// to what a float holds.
#pragma once

#include "base/pose.h"
#include "library_client.h"

void assert_library_matrix(const struct library_tool *tool, pose p);     // of TRANSFORM, TDATA
void assert_library_quaternion(const struct library_tool *tool, pose p); // of QTDATA
