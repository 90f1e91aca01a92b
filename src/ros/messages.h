// The package's own messages, next to the core's types.
#pragma once

// The message and the core's struct of the same name share the namespace tissue_sim: here the
// message is FrameInputMessage. On the wire and in bags it is tissue_sim/FrameInput.
#define FrameInput FrameInputMessage
#include <tissue_sim/FrameInput.h>
#undef FrameInput

#include <tissue_sim/FluidArray.h>
#include <tissue_sim/FragmentArray.h>
#include <tissue_sim/JawGrip.h>
#include <tissue_sim/SavedState.h>
#include <tissue_sim/SimulationState.h>
