package tessera.spy;

import java.awt.Color;
import java.awt.Graphics2D;
import java.util.Collection;

/** Draws positions seen from above: x to the right, z (forward of the first camera) up, both to one scale. */
final class FromAbove {
  private static final int MARGIN_PX = 30;
  private double left = Double.POSITIVE_INFINITY, right = Double.NEGATIVE_INFINITY;
  private double bottom = Double.POSITIVE_INFINITY, top = Double.NEGATIVE_INFINITY;
  private double scale = 1;
  private int width, height;

  /** Everything of these is to be in sight. */
  void include(Collection<double[]> positions) {
    for (double[] position : positions) {
      left = Math.min(left, position[0]);
      right = Math.max(right, position[0]);
      bottom = Math.min(bottom, position[2]);
      top = Math.max(top, position[2]);
    }
  }

  /** To be called when all is included. False if that is nothing. */
  boolean fit(int widthPx, int heightPx) {
    width = widthPx;
    height = heightPx;
    if (left > right) return false;
    double across = Math.max(right - left, 1e-3), along = Math.max(top - bottom, 1e-3);
    scale = Math.min((width - 2 * MARGIN_PX) / across, (height - 2 * MARGIN_PX) / along);
    return true;
  }

  void drawPoints(Graphics2D graphics, Collection<double[]> positions, Color color, int size) {
    graphics.setColor(color);
    for (double[] position : positions) {
      graphics.fillRect(column(position) - size / 2, row(position) - size / 2, size, size);
    }
  }

  void drawLine(Graphics2D graphics, Collection<double[]> positions, Color color) {
    graphics.setColor(color);
    double[] before = null;
    for (double[] position : positions) {
      if (before != null) graphics.drawLine(column(before), row(before), column(position), row(position));
      before = position;
    }
  }

  private int column(double[] position) {
    return (int) Math.round(width / 2.0 + scale * (position[0] - (left + right) / 2));
  }

  private int row(double[] position) {
    return (int) Math.round(height / 2.0 - scale * (position[2] - (bottom + top) / 2));
  }
}
