package tessera.spy;

import java.awt.Color;
import java.awt.Dimension;
import java.awt.FontMetrics;
import java.awt.Graphics;
import java.awt.Graphics2D;
import java.awt.RenderingHints;
import java.awt.event.WindowAdapter;
import java.awt.event.WindowEvent;
import java.io.IOException;
import java.util.ArrayList;
import java.util.List;
import javax.swing.JComponent;
import javax.swing.JDesktopPane;
import javax.swing.JFrame;
import javax.swing.SwingUtilities;
import javax.swing.Timer;
import lcm.lcm.LCM;
import lcm.lcm.LCMDataInputStream;
import lcm.lcm.LCMSubscriber;

/**
 * A window that listens to channels while it is open. Messages come in threads of LCM and are drawn in that of Swing: both
 * hold this object's lock.
 */
abstract class LiveView extends JComponent implements LCMSubscriber {
  private static final int REDRAW_MS = 100;
  static final Color BACKGROUND = new Color(18, 20, 24);
  static final Color TEXT = new Color(200, 200, 200);

  private final List<LCM> buses = new ArrayList<>();
  private boolean hasNews = true;

  LiveView(int width, int height) {
    setPreferredSize(new Dimension(width, height));
  }

  /** Takes what it shows of a message. */
  abstract void receive(String channel, LCMDataInputStream message) throws IOException;

  abstract void draw(Graphics2D graphics);

  /** In the top left corner, on a ground of its own: images may be bright there. */
  final void drawWords(Graphics2D graphics, String words) {
    FontMetrics font = graphics.getFontMetrics();
    graphics.setColor(BACKGROUND);
    graphics.fillRect(0, 0, font.stringWidth(words) + 20, font.getHeight() + 8);
    graphics.setColor(TEXT);
    graphics.drawString(words, 10, 18);
  }

  final void listen(LCM bus, String channel) {
    if (!buses.contains(bus)) buses.add(bus);
    bus.subscribe(channel.replaceAll("[^A-Za-z0-9_]", "."), this);
  }

  /** In the window that lcm-spy has opened for it, whose empty `desktop` it replaces. */
  final void open(JDesktopPane desktop, String title) {
    JFrame frame = (JFrame) SwingUtilities.getWindowAncestor(desktop);
    Timer timer = new Timer(REDRAW_MS, event -> repaintIfNew());
    frame.setTitle(title);
    frame.setContentPane(this);
    frame.addWindowListener(
        new WindowAdapter() {
          @Override
          public void windowClosing(WindowEvent event) {
            timer.stop();
            buses.forEach(LCM::close);
            frame.dispose();
          }
        });
    frame.pack();
    timer.start();
  }

  @Override
  public final synchronized void messageReceived(LCM bus, String channel, LCMDataInputStream message) {
    try {
      receive(channel, message);
      hasNews = true;
    } catch (IOException | RuntimeException error) {
      // Bytes of another version, or damaged ones: lcm-spy counts them as undecodable.
    }
  }

  @Override
  protected final synchronized void paintComponent(Graphics graphics) {
    graphics.setColor(BACKGROUND);
    graphics.fillRect(0, 0, getWidth(), getHeight());
    Graphics2D drawing = (Graphics2D) graphics;
    drawing.setRenderingHint(RenderingHints.KEY_ANTIALIASING, RenderingHints.VALUE_ANTIALIAS_ON);
    draw(drawing);
  }

  private synchronized void repaintIfNew() {
    if (hasNews) repaint();
    hasNews = false;
  }
}
