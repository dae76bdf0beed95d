// The attributes of an image: words and single numbers about the session (EXR.md).
#pragma once

#include "export/contents.h"
#include "export/image.h"

// Into the file's first part.
void exr_describe(const struct contents *contents, struct image_writer *writer);
