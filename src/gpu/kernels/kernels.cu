// All kernels, from one source: `.ci/ptx` compiles it for devices, and gcc for the tests.

#include "language.h"
#include "vectors.h"
#include "data.h"
#include "recorded.h"
#include "multigrid.h"
#include "points.h"
#define DIMENSION 1
#include "transfer.h"
#define DIMENSION 2
#include "transfer.h"
#define DIMENSION 3
#include "transfer.h"
