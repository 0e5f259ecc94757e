// A folder for what one run writes.
#pragma once

#include <string>

#include "support/temporary_folder.h"

namespace tessera {

class RunFolder : public TemporaryFolder {
 public:
  std::string File(const std::string& name) const { return path(name); }
};

}  // namespace tessera
