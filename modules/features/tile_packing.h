// Jobs for links that are slower than a compressor, packed without loss. A pixel is predicted from its neighbors as in
// LOCO-I (M. Weinberger, G. Seroussi, G. Sapiro, "The LOCO-I Lossless Image Compression Algorithm", 2000),
//
//   predicted = median(left, above, left + above - above left)          outside of the image: 0
//
// and what it differs from that, modulo 256 (depth: 65536), is compressed by Zstandard. README.md has sizes and times.
#pragma once

#include "core/result.h"
#include "features/feature_types.h"

namespace tessera {

// The same job with its images in `packed` alone.
TileJob PackTile(const TileJob& job);

// Undoes it; a job that isn't packed is left as it is. Fails if `packed` isn't what the job's rectangles need.
Result<> UnpackTile(TileJob& job);

}  // namespace tessera
