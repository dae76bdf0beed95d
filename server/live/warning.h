// The most urgent warning about a station, in one line for a person.
#pragma once

#include "wire/wire.h"

enum urgency { URGENCY_NONE, URGENCY_LOOK, URGENCY_ACT, URGENCY_NOW };

// Sets the place's warning from its other fields. drift_mm: the drift of touches that is accepted.
void warning_of_place(arthron_Place *place, double drift_mm);
