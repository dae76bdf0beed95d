// Scratch of link.c.
#pragma once

struct linker;

struct linker *linker_create(void);
void linker_destroy(struct linker **linker);
