package tessera.spy;

import java.awt.Color;
import java.awt.Graphics2D;
import java.awt.image.BufferedImage;
import java.io.IOException;
import java.util.LinkedHashMap;
import java.util.Map;
import lcm.lcm.LCMDataInputStream;
import tessera.camera_image_t;
import tessera.features_t;
import tessera.image_band_t;
import tessera.keyframe_t;
import tessera.keypoints_t;

/** The left image of the newest frame whose keypoints are there too, put together from its bands. */
final class ImageView extends LiveView {
  private static final Color KEYPOINT = new Color(75, 150, 255), TRACKED = new Color(70, 200, 90);
  private static final int NUM_KEPT = 16, MAX_SIDE_PX = 1 << 14;

  /** What is known of one frame. */
  private static final class Frame {
    BufferedImage image;
    int numRows;
    float[] x = {}, y = {};
    boolean[] isTracked = {};
    int numKeypoints;

    boolean hasImage() {
      return image != null && numRows == image.getHeight();
    }

    boolean hasKeypoints() {
      return numKeypoints > 0 && numKeypoints == x.length;
    }
  }

  private final Map<Long, Frame> frames =
      new LinkedHashMap<>() {
        @Override
        protected boolean removeEldestEntry(Map.Entry<Long, Frame> eldest) {
          return size() > NUM_KEPT;
        }
      };

  ImageView() {
    super(1000, 420);
  }

  @Override
  void receive(String channel, LCMDataInputStream message) throws IOException {
    if (channel.endsWith("CAMERA")) {
      add(new camera_image_t(message));
    } else if (channel.endsWith("FEATURES")) {
      add(new features_t(message).keypoints, null);
    } else {
      keyframe_t keyframe = new keyframe_t(message);
      add(keyframe.keypoints, keyframe.landmarks);
    }
  }

  @Override
  void draw(Graphics2D graphics) {
    long newest = -1;
    for (Map.Entry<Long, Frame> entry : frames.entrySet()) {
      Frame shown = frames.get(newest), frame = entry.getValue();
      boolean isBetter = shown == null || rank(frame) > rank(shown) || rank(frame) == rank(shown) && entry.getKey() > newest;
      if (rank(frame) > 0 && isBetter) newest = entry.getKey();
    }
    Frame frame = frames.get(newest);
    if (frame == null) {
      drawWords(graphics, "waiting for images and keypoints");
      return;
    }
    draw(graphics, frame);
    String without = frame.hasImage() ? "" : " (its image has not come)";
    drawWords(graphics, "frame " + newest + ", " + frame.x.length + " keypoints" + without);
  }

  private static int rank(Frame frame) {
    return (frame.hasImage() ? 1 : 0) + (frame.hasKeypoints() ? 1 : 0);
  }

  private void draw(Graphics2D graphics, Frame frame) {
    double scale = 1;
    if (frame.hasImage()) {
      scale = Math.min((double) getWidth() / frame.image.getWidth(), (double) getHeight() / frame.image.getHeight());
      int width = (int) (scale * frame.image.getWidth()), height = (int) (scale * frame.image.getHeight());
      graphics.drawImage(frame.image, 0, 0, width, height, null);
    }
    for (int i = 0; i < frame.x.length; i++) {
      graphics.setColor(frame.isTracked[i] ? TRACKED : KEYPOINT);
      int column = (int) (scale * (frame.x[i] + 0.5)), row = (int) (scale * (frame.y[i] + 0.5));
      graphics.fillOval(column - 2, row - 2, 4, 4);
    }
  }

  private void add(camera_image_t message) {
    image_band_t band = message.band;
    boolean isLeft = band.image == image_band_t.LEFT && band.encoding == image_band_t.GRAY8;
    boolean isSane = message.width > 0 && message.width <= MAX_SIDE_PX && message.height > 0 && message.height <= MAX_SIDE_PX;
    if (!isLeft || !isSane) return;
    Frame frame = frames.computeIfAbsent(message.frame, number -> new Frame());
    if (frame.image == null) {
      frame.image = new BufferedImage(message.width, message.height, BufferedImage.TYPE_BYTE_GRAY);
    }
    frame.image.getRaster().setDataElements(band.pixels.x, band.pixels.y, band.pixels.width, band.pixels.height, band.data);
    frame.numRows += band.pixels.height;
  }

  /** `landmarks`: by keypoint, -1 where it shows none; null where that is unknown. */
  private void add(keypoints_t part, long[] landmarks) {
    if (part.num_total < 0 || part.num_total > 1 << 20) return;
    Frame frame = frames.computeIfAbsent(part.frame, number -> new Frame());
    if (frame.x.length != part.num_total) {
      frame.x = new float[part.num_total];
      frame.y = new float[part.num_total];
      frame.isTracked = new boolean[part.num_total];
      frame.numKeypoints = 0;
    }
    System.arraycopy(part.x, 0, frame.x, part.first, part.num_keypoints);
    System.arraycopy(part.y, 0, frame.y, part.first, part.num_keypoints);
    for (int i = 0; landmarks != null && i < part.num_keypoints; i++) frame.isTracked[part.first + i] = landmarks[i] >= 0;
    frame.numKeypoints = Math.min(part.num_total, frame.numKeypoints + part.num_keypoints);
  }
}
