// What is most urgent about a station, in one line for a person.
#pragma once

#include "wire/wire.h"

enum urgency { URGENCY_NONE, URGENCY_LOOK, URGENCY_ACT, URGENCY_NOW };

// From all else that is in the place; drift_mm: what its touches may be off.
void warning_of_place(arthron_Place *place, double drift_mm);
