#include "map/spanning_tree.h"

namespace tessera {

KeyframeId RootOf(const Map& map, KeyframeId id) {
  while (true) {
    const KeyframeId parent = map.FindKeyframe(id)->parent;
    if (!parent.valid()) return id;
    id = parent;
  }
}

std::vector<KeyframeId> Roots(const Map& map) {
  std::vector<KeyframeId> roots;
  map.keyframes().ForEach([&](KeyframeId id, const Keyframe& keyframe) {
    if (!keyframe.parent.valid()) roots.push_back(id);
  });
  return roots;
}

// A tree may be as deep as the map is long, so what was found on one way to the root is not looked for on the next.
std::vector<KeyframeId> MapPartOf(const Map& map, KeyframeId id) {
  enum class Membership : char { kUnknown, kInside, kOutside };
  std::vector<Membership> membership(static_cast<size_t>(map.keyframes().end_id()), Membership::kUnknown);
  const auto of = [&](KeyframeId keyframe) -> Membership& { return membership[static_cast<size_t>(keyframe.value)]; };
  of(RootOf(map, id)) = Membership::kInside;
  std::vector<KeyframeId> part, way;
  map.keyframes().ForEach([&](KeyframeId keyframe, const Keyframe&) {
    way.clear();
    KeyframeId ancestor = keyframe;
    for (; ancestor.valid() && of(ancestor) == Membership::kUnknown; ancestor = map.FindKeyframe(ancestor)->parent) {
      way.push_back(ancestor);
    }
    const Membership found = ancestor.valid() ? of(ancestor) : Membership::kOutside;
    for (const KeyframeId member : way) of(member) = found;
    if (found == Membership::kInside) part.push_back(keyframe);
  });
  return part;
}

void AttachTree(KeyframeId id, KeyframeId parent, MapEditor& editor) {
  while (id.valid()) {
    const KeyframeId old_parent = editor.map().FindKeyframe(id)->parent;
    editor.SetParent(id, parent);
    parent = id;
    id = old_parent;
  }
}

}  // namespace tessera
