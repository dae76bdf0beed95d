#include "mesh/convex.h"
