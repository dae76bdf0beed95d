#include "cut/blade.h"
