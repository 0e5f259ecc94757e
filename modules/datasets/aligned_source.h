// Pairs whose rows don't belong together, put straight: a camera of the pair was knocked, or calibrated badly.
#pragma once

#include <functional>
#include <memory>

#include "datasets/frame_source.h"

namespace tessera {

// The source itself where it is no pair, or where its rows are right to a third of a pixel; else one whose right images
// are turned to where its calibration has them, and which tells so. `open`: the same source with other frames. It is
// measured on frames 0, 8, 16 and 24, whatever frames are wanted, so that a camera that is started again turns images
// likewise.
std::unique_ptr<FrameSource> AlignRows(std::unique_ptr<FrameSource> source, const SourceOptions& options,
                                       const std::function<std::unique_ptr<FrameSource>(const SourceOptions&)>& open);

}  // namespace tessera
