package tessera.spy;

import java.awt.event.ActionEvent;
import java.io.IOException;
import javax.swing.AbstractAction;
import javax.swing.Action;
import javax.swing.JDesktopPane;
import lcm.lcm.LCM;
import lcm.spy.ChannelData;
import lcm.spy.SpyPlugin;
import tessera.map_delta_t;
import tessera.map_snapshot_t;

/** MAP_DELTA and MAP_SNAPSHOT: the map from above, and each change in a line. */
public final class MapPlugin implements SpyPlugin {
  @Override
  public boolean canHandle(long fingerprint) {
    return fingerprint == map_delta_t.LCM_FINGERPRINT || fingerprint == map_snapshot_t.LCM_FINGERPRINT;
  }

  @Override
  public Action getAction(JDesktopPane desktop, ChannelData channel) {
    return new AbstractAction("Map from above") {
      @Override
      public void actionPerformed(ActionEvent event) {
        try {
          String prefix = Buses.prefixOf(channel.name, "MAP_DELTA", "MAP_SNAPSHOT");
          MapView view = new MapView();
          LCM bus = Buses.map();
          view.listen(bus, prefix + "MAP_DELTA");
          view.listen(bus, prefix + "MAP_SNAPSHOT");
          view.open(desktop, channel.name + ": map from above");
        } catch (IOException error) {
          System.err.println("the map can't be shown: " + error.getMessage());
        }
      }
    };
  }
}
