#include "map/spanning_tree.h"

namespace tessera {

KeyframeId RootOf(const Map& map, KeyframeId id) {
  while (true) {
    const KeyframeId parent = map.FindKeyframe(id)->parent;
    if (!parent.valid()) return id;
    id = parent;
  }
}

void HangBelow(KeyframeId id, KeyframeId parent, MapEditor& editor) {
  while (id.valid()) {
    const KeyframeId old_parent = editor.map().FindKeyframe(id)->parent;
    editor.SetParent(id, parent);
    parent = id;
    id = old_parent;
  }
}

}  // namespace tessera
