// Signals that arrive while a kernel runs.
#pragma once

namespace adhesis {

// Throw if a signal's handler in Python raises: an interrupt, or a time limit. Long kernels call it
// between their steps, where what they change is complete.
void check_signals();

}  // namespace adhesis
