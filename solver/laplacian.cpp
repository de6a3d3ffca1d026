#include "solver/laplacian.h"
