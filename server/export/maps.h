// The changes of touch by cuts, as images over the surfaces' atlas (EXR.md).
#pragma once

#include "export/contents.h"
#include "export/image.h"

struct maps;

// Runs the record's jobs, those before the time asked for too. The request has a scene, which must
// outlive the maps. RESULT_REFUSED where it is of another case than the record.
enum result maps_create(struct walk *walk, struct maps **out_maps, struct error *err);
void maps_destroy(struct maps **maps); // NULL inside is fine

void maps_declare(const struct maps *maps, struct image_writer *writer);
void maps_write(const struct maps *maps, struct image_writer *writer); // as declared
