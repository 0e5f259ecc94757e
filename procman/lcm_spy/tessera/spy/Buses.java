package tessera.spy;

import java.io.IOException;
import java.lang.reflect.Field;
import java.net.DatagramSocket;
import lcm.lcm.LCM;

/** The buses of the stack that is looked at; `tessera spy` names them in the environment. */
final class Buses {
  private static final int RECEIVE_BUFFER_BYTES = 4 << 20;

  private Buses() {}

  static LCM main() throws IOException {
    return open("TESSERA_MAIN_URL");
  }

  /** Features, keyframes and the map; on one machine it is the main one. */
  static LCM map() throws IOException {
    return open("TESSERA_MAP_URL");
  }

  static LCM camera() throws IOException {
    return open("TESSERA_CAMERA_URL");
  }

  /** Of a robot's channel, such as B_POSE of POSE: B_. */
  static String prefixOf(String channel, String... names) {
    for (String name : names) {
      if (channel.endsWith(name)) return channel.substring(0, channel.length() - name.length());
    }
    return "";
  }

  private static LCM open(String variable) throws IOException {
    String url = System.getenv(variable);
    LCM bus = url == null ? new LCM() : new LCM(url);
    try {
      enlargeReceiveBuffers(bus);
    } catch (ReflectiveOperationException | RuntimeException error) {
      // Another version of LCM: bands of images may be lost, as in any listener that is too slow.
    }
    return bus;
  }

  /** LCM for Java leaves them at the system's default of 208 KiB, has no option for it, and an image is larger. */
  private static void enlargeReceiveBuffers(LCM bus) throws ReflectiveOperationException, IOException {
    Field providers = LCM.class.getDeclaredField("providers");
    providers.setAccessible(true);
    for (Object provider : (Iterable<?>) providers.get(bus)) {
      Field socket = provider.getClass().getDeclaredField("sock");
      socket.setAccessible(true);
      ((DatagramSocket) socket.get(provider)).setReceiveBufferSize(RECEIVE_BUFFER_BYTES);
    }
  }
}
