package tessera.spy;

import java.awt.Color;
import java.awt.Graphics2D;
import java.io.IOException;
import java.util.ArrayDeque;
import java.util.Arrays;
import java.util.Deque;
import java.util.Map;
import java.util.TreeMap;
import lcm.lcm.LCMDataInputStream;
import tessera.map_change_t;
import tessera.map_delta_t;
import tessera.map_keyframe_t;
import tessera.map_landmark_t;
import tessera.map_snapshot_t;

/** The landmarks and keyframes of the changes that came while the window was open: the spy asks for nothing. */
final class MapView extends LiveView {
  private static final Color LANDMARK = new Color(90, 170, 140), KEYFRAME = new Color(75, 150, 255);
  private static final int NUM_LINES = 8, LINE_PX = 15;
  private static final String[] WHAT = {
    "new keyframes", "moved keyframes", "removed keyframes", "new or changed landmarks", "removed landmarks",
    "new observations", "removed observations", "closed loops"
  };
  private final Map<Long, double[]> landmarks = new TreeMap<>(), keyframes = new TreeMap<>();
  private final Deque<String> lines = new ArrayDeque<>();
  private String lastTitle = "";
  private final int[] counts = new int[WHAT.length];

  MapView() {
    super(800, 700);
  }

  @Override
  void receive(String channel, LCMDataInputStream message) throws IOException {
    if (channel.endsWith("MAP_SNAPSHOT")) {
      map_snapshot_t page = new map_snapshot_t(message);
      apply(page.change);
      tell("snapshot of delta " + page.number, page.change);
    } else {
      map_delta_t delta = new map_delta_t(message);
      apply(delta.change);
      tell("delta " + delta.number + " answers keyframe " + delta.answers, delta.change);
    }
  }

  @Override
  void draw(Graphics2D graphics) {
    int height = getHeight() - NUM_LINES * LINE_PX;
    FromAbove above = new FromAbove();
    // Landmarks may be far away: the keyframes decide what is in sight, and the landmarks if there are none.
    above.include(keyframes.isEmpty() ? landmarks.values() : keyframes.values());
    if (above.fit(getWidth(), height)) {
      above.drawPoints(graphics, landmarks.values(), LANDMARK, 2);
      above.drawLine(graphics, keyframes.values(), KEYFRAME);
      above.drawPoints(graphics, keyframes.values(), KEYFRAME, 5);
    }
    graphics.setColor(BACKGROUND);
    graphics.fillRect(0, height, getWidth(), getHeight() - height);
    drawWords(graphics, keyframes.size() + " keyframes, " + landmarks.size() + " landmarks heard of");
    int row = height + LINE_PX;
    for (String line : lines) {
      graphics.drawString(line, 10, row);
      row += LINE_PX;
    }
    if (lines.isEmpty()) graphics.drawString("waiting for changes of the map", 10, row);
  }

  private void apply(map_change_t change) {
    for (map_keyframe_t keyframe : change.new_keyframes) {
      keyframes.put(keyframe.keyframe, keyframe.world_from_camera.translation);
    }
    for (int i = 0; i < change.num_moved_keyframes; i++) {
      keyframes.put(change.moved_keyframes[i], change.world_from_camera[i].translation);
    }
    for (map_landmark_t landmark : change.landmarks) landmarks.put(landmark.landmark, landmark.position_in_world);
    for (long number : change.removed_landmarks) landmarks.remove(number);
    for (long number : change.removed_keyframes) keyframes.remove(number);
  }

  /** What comes in parts is one line. */
  private void tell(String title, map_change_t change) {
    if (!title.equals(lastTitle)) {
      Arrays.fill(counts, 0);
    } else {
      lines.removeLast();
    }
    lastTitle = title;
    int[] more = {
      change.num_new_keyframes, change.num_moved_keyframes, change.num_removed_keyframes,
      change.num_landmarks, change.num_removed_landmarks, change.num_new_observations,
      change.num_removed_observations, change.num_closed_loops
    };
    StringBuilder words = new StringBuilder(title).append(':');
    for (int i = 0; i < counts.length; i++) {
      counts[i] += more[i];
      if (counts[i] > 0) words.append(' ').append(counts[i]).append(' ').append(WHAT[i]).append(',');
    }
    lines.addLast(words.substring(0, words.length() - 1));
    if (lines.size() > NUM_LINES - 1) lines.removeFirst();
  }
}
