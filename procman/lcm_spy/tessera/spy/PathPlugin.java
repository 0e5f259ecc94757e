package tessera.spy;

import java.awt.event.ActionEvent;
import java.io.IOException;
import javax.swing.AbstractAction;
import javax.swing.Action;
import javax.swing.JDesktopPane;
import lcm.lcm.LCM;
import lcm.spy.ChannelData;
import lcm.spy.SpyPlugin;
import tessera.ground_truth_t;
import tessera.pose_t;

/** POSE and GROUND_TRUTH: the path from above. */
public final class PathPlugin implements SpyPlugin {
  @Override
  public boolean canHandle(long fingerprint) {
    return fingerprint == pose_t.LCM_FINGERPRINT || fingerprint == ground_truth_t.LCM_FINGERPRINT;
  }

  @Override
  public Action getAction(JDesktopPane desktop, ChannelData channel) {
    return new AbstractAction("Path from above") {
      @Override
      public void actionPerformed(ActionEvent event) {
        try {
          String prefix = Buses.prefixOf(channel.name, "POSE", "GROUND_TRUTH");
          PathView view = new PathView();
          LCM bus = Buses.main();
          view.listen(bus, prefix + "POSE");
          view.listen(bus, prefix + "GROUND_TRUTH");
          view.open(desktop, channel.name + ": path from above");
        } catch (IOException error) {
          System.err.println("the path can't be shown: " + error.getMessage());
        }
      }
    };
  }
}
