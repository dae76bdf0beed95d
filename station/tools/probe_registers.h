// What `arthron-station probe` makes of the registers of a Modbus slave. No line.
#pragma once

#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>

#define PROBE_REGISTERS_MAX 48
#define PROBE_READINGS 4

// Registers from 0 on, read several times.
struct probe_block {
    int count;
    uint16_t values[PROBE_READINGS][PROBE_REGISTERS_MAX];
};

// The register that rises from reading to reading; -1: none does.
int probe_sequence(const struct probe_block *block);

// Lines of a device's section: values, as far as they can be guessed, and comments for the rest.
// `is_first`: no other slave gives the joint.
void probe_propose_registers(const struct probe_block *block, bool is_first, FILE *config);
