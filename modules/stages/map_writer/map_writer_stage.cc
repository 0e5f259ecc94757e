#include "stages/map_writer/map_writer_stage.h"

#include <cstdio>

#include "core/errors.h"
#include "core/files.h"
#include "evaluation/map_ply.h"

namespace tessera {
namespace {

std::string PathFrom(const Settings& settings) {
  auto path = settings.Get<MapWriterSettings>().path;
  if (path.empty()) {
    throw InputError("map_writer.path is empty: say where the map goes with --set map_writer.path=FILE.ply");
  }
  return path;
}

}  // namespace

MapWriterStage::MapWriterStage(StageContext& context)
    : context_(context),
      path_(PathFrom(context.settings())),
      follows_(context.settings().Get<MapWriterSettings>().follow),
      map_(
          context, true, [this](const MapFollower::Delta& delta) { return Apply(*delta); }, [this] { WriteIfDone(); }) {
  map_.FollowToEnd();
}

Result<> MapWriterStage::Apply(const MapDelta& delta) {
  TESSERA_RETURN_IF_FAILED(replica_.Apply(delta));
  context_.SetValue("deltas", static_cast<double>(replica_.next_delta()));
  return {};
}

// Each delta brought the owner's hash, and Apply() compared it: a replica that is not rejected has the owner's map.
void MapWriterStage::WriteIfDone() {
  const bool is_there = replica_.next_delta() > 0 && !map_.needs_snapshot();
  if (context_.finished() || !is_there || (follows_ && !map_.is_complete())) return;
  try {
    WriteFile(path_, PlyFile(replica_, context_.settings().Get<BodySettings>().BaseFromCamera()));
  } catch (const InputError& error) {
    context_.Fail(error.what(), 2);
    return;
  }
  std::printf("map after delta %lld: %lld keyframes, %lld landmarks, hash %016llx as the mapper's, SHA-256 %s\n",
              static_cast<long long>(replica_.next_delta() - 1), static_cast<long long>(replica_.keyframes().size()),
              static_cast<long long>(replica_.landmarks().size()), static_cast<unsigned long long>(replica_.hash()),
              replica_.Sha256Hex().c_str());
  std::fflush(stdout);
  context_.Finish();
}

}  // namespace tessera
