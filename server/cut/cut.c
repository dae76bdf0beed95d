#include "cut/cut.h"
