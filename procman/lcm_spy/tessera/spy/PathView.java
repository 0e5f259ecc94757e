package tessera.spy;

import java.awt.Color;
import java.awt.Graphics2D;
import java.io.IOException;
import java.util.ArrayList;
import java.util.List;
import lcm.lcm.LCMDataInputStream;
import tessera.ground_truth_t;
import tessera.pose_t;

/** The path as it was published; of a channel of true poses, the true one. */
final class PathView extends LiveView {
  private static final Color ESTIMATE = new Color(240, 190, 60), TRUTH = new Color(150, 150, 150);
  private static final String[] STATES = {"initializing", "tracked", "lost"};
  private final List<double[]> estimate = new ArrayList<>(), truth = new ArrayList<>();
  private pose_t last;

  PathView() {
    super(700, 600);
  }

  @Override
  void receive(String channel, LCMDataInputStream message) throws IOException {
    if (channel.endsWith("GROUND_TRUTH")) {
      truth.add(new ground_truth_t(message).world_from_camera.translation);
      return;
    }
    last = new pose_t(message);
    if (last.state == pose_t.TRACKED) estimate.add(last.world_from_camera.translation);
  }

  @Override
  void draw(Graphics2D graphics) {
    FromAbove above = new FromAbove();
    List<double[]> path = estimate.isEmpty() ? truth : estimate;
    above.include(path);
    if (above.fit(getWidth(), getHeight())) {
      above.drawLine(graphics, path, estimate.isEmpty() ? TRUTH : ESTIMATE);
      above.drawPoints(graphics, path.subList(path.size() - 1, path.size()), Color.WHITE, 6);
    }
    drawWords(graphics, words());
  }

  private String words() {
    if (last == null) return truth.isEmpty() ? "waiting for poses" : truth.size() + " true poses";
    String state = last.state >= 0 && last.state < STATES.length ? STATES[last.state] : "?";
    return String.format(
        "frame %d: %s, %d matches, %d inliers, %d landmarks in the map",
        last.frame, state, last.num_matches, last.num_inliers, last.num_landmarks);
  }
}
