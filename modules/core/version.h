// The project's version, such as "1.0.0" (the file VERSION).
#pragma once

namespace tessera {

extern const char* const kVersion;

}  // namespace tessera
