package tessera.spy;

import java.awt.event.ActionEvent;
import java.io.IOException;
import javax.swing.AbstractAction;
import javax.swing.Action;
import javax.swing.JDesktopPane;
import lcm.lcm.LCM;
import lcm.spy.ChannelData;
import lcm.spy.SpyPlugin;
import tessera.camera_image_t;
import tessera.features_t;
import tessera.keyframe_t;

/** CAMERA, FEATURES and KEYFRAME: the image with its keypoints. */
public final class ImagePlugin implements SpyPlugin {
  @Override
  public boolean canHandle(long fingerprint) {
    return fingerprint == camera_image_t.LCM_FINGERPRINT
        || fingerprint == features_t.LCM_FINGERPRINT
        || fingerprint == keyframe_t.LCM_FINGERPRINT;
  }

  @Override
  public Action getAction(JDesktopPane desktop, ChannelData channel) {
    return new AbstractAction("Image with keypoints") {
      @Override
      public void actionPerformed(ActionEvent event) {
        try {
          String prefix = Buses.prefixOf(channel.name, "CAMERA", "FEATURES", "KEYFRAME");
          ImageView view = new ImageView();
          LCM bus = Buses.map();
          view.listen(Buses.camera(), prefix + "CAMERA");
          view.listen(bus, prefix + "FEATURES");
          view.listen(bus, prefix + "KEYFRAME");
          view.open(desktop, channel.name + ": image with keypoints");
        } catch (IOException error) {
          System.err.println("the image can't be shown: " + error.getMessage());
        }
      }
    };
  }
}
