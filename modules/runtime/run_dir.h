// The folder that the processes of a run on one node share (bus.run_dir). Who starts them makes it, readable for its
// owner alone, with the run's secret in the file `secret`: 64 hexadecimal digits.
#pragma once

#include <cstdint>
#include <string>

#include "streams/authenticator.h"

namespace tessera {

// Throws InputError if there is no secret, or if others may read it.
Authenticator::Secret ReadRunSecret(const std::string& run_dir);

// The epoch of a process that starts: the wall clock, or more than all earlier ones of its name had here if the clock
// was set back meanwhile; receivers take the largest epoch for the newest. Remembered in the file epoch-NAME; one that
// can't be written is done without.
int64_t BeginEpoch(const std::string& run_dir, const std::string& name, int64_t wall_us);

}  // namespace tessera
