// A small set of traces with something of every kind.
#pragma once

#include "core/bake/bake_traces.h"

namespace lightloom::test {

BakeTraces sample_traces();

}  // namespace lightloom::test
