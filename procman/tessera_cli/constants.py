"""Names and numbers that the whole command shares: ports, channels, limits, periods and time-outs."""

# --- Network ------------------------------------------------------------------------------------------------------
MULTICAST_GROUP = "239.255.76.67"
# On a LAN, what is large has groups of its own: a switch that snoops IGMP delivers it to those hosts alone that listen.
# {id} is the extractor's.
LAN_GROUPS = {"camera": "239.255.76.68", "work": "239.255.76.69", "map": "239.255.76.70", "color": "239.255.76.71"}
LAN_TILE_GROUP = "239.255.77.{id}"
DEFAULT_PORT = 7667
# Of each bus, from the base port (--port).
PORT_OFFSETS = {"main": 0, "camera": 1, "work": 2, "procman": 3, "map": 4, "color": 5}
# Those whose URLs are settings of a stack.
STACK_BUSES = ("main", "camera", "color", "work", "map")
FIRST_TILE_PORT_OFFSET = 13
# A message that fits one packet of a LAN: the loss of one fragment would lose a larger message whole.
LAN_MESSAGE_BYTES = 1400
# Of tiles and their features, which are many: six full packets, of 1500 bytes less 20 of IP's header; 8 are UDP's.
# A message costs a slow node more than a packet does.
LAN_WORK_MESSAGE_BYTES = 6 * 1480 - 8
# Bursts of tiles need receive buffers of this size; setup.sh raises the kernel's limit to it.
RECEIVE_BUFFER_BYTES = 4194304
# Messages that LCM keeps for a subscriber. Poses come in bursts, and LCM's default of 30 would drop some.
QUEUE_CAPACITY = 1000
# On a LAN, where a change of the map is some hundred messages.
LAN_QUEUE_CAPACITY = 20_000
# Messages handled before a loop looks at its processes again.
MAX_MESSAGES_PER_TURN = 200

# --- Channels (lcmtypes/README.md) --------------------------------------------------------------------------------
STATUS, POSE, HEARTBEAT, CAMERA, END_OF_STREAM = "STATUS", "POSE", "HEARTBEAT", "CAMERA", "END_OF_STREAM"
REPAIR, COLOR = "REPAIR", "COLOR"
PROCMAN_ORDER, PROCMAN_STATUS, PROCMAN_OUTPUT = "PROCMAN_ORDER", "PROCMAN_STATUS", "PROCMAN_OUTPUT"

# --- Limits -------------------------------------------------------------------------------------------------------
# Extractors that a dispatcher accepts, and keypoints that one extracts: kMaxExtractors, FeatureOptions::kMaxFeatures.
MAX_INSTANCES = 256
MAX_FEATURES = 50000
# Of a process list or an order. A list of a hundred nodes takes some tens of kilobytes.
MAX_LIST_BYTES = 1_000_000
MAX_ORDER_BYTES = 1_000_000
# Output of one process that is forwarded per OUTPUT_PERIOD_S: 10 kB/s, which leaves the network to images.
MAX_OUTPUT_BYTES = 2000
# The end of a log travels in pieces that fit one packet of any network.
TAIL_PIECE_BYTES = 1000
LOG_FILE_BYTES = 10_000_000
NUM_OLD_LOG_FILES = 3
# Of a live run: one that is extracted while another is tracked. More of them would wait for the tracker.
LIVE_FRAMES_IN_FLIGHT = 2
# More extractors than this are shown as one, in the live panel and in reports.
MAX_EXTRACTORS_SHOWN = 4

# Of the logarithm of mono's scale, what the images of the last seconds leave open: from here on it may have slipped.
# On ordinary sequences it stays below 0.1.
MAX_SCALE_SIGMA = 0.25

# --- Periods, in seconds unless the name says otherwise -----------------------------------------------------------
# One turn of a loop that waits for messages.
LISTEN_S = 0.05
# Deputies publish their status so often; stages publish theirs twice as often.
DEPUTY_STATUS_PERIOD_S = 1.0
USAGE_PERIOD_S = 1.0
OUTPUT_PERIOD_S = 0.2
ORDER_REPEAT_S = 0.3
STOP_POLL_S = 0.01
RECORDING_POLL_S = 0.1
MAP_SAVE_PERIOD_S = 60.0
# In a run's folder: the map that it began with.
LOADED_MAP = "loaded.tessera"
EXPERIMENT_POLL_S = 0.1
RUN_PANEL_PERIOD_S = 0.25
WATCH_PANEL_PERIOD_S = 0.5
# The mapper may be in the middle of a bundle adjustment: asking for the map more often helps nobody.
MAP_ASK_S = 1.0
# Between two lines where there is no terminal.
LINE_PERIOD_S = 5.0
# The frame rate shown is that of the last poses only, so that it follows changes.
FRAME_RATE_WINDOW_S = 5.0

# --- Time-outs of a run -------------------------------------------------------------------------------------------
# A bus without a heartbeat for this long is free: also a stage that has nothing to say sends one each 0.4 s.
FREE_BUS_S = 0.5
# A process that does not report within this time never will; LCM's self-test alone may take 10 s.
START_TIMEOUT_S = 20.0
# A stored source without a new pose for this long is stuck, unless a stage works on the map: repairs and late tiles
# take a few seconds, but the adjustment of a large map, which frames may have to wait for, takes minutes. A stage that
# goes through its journal is waited for as long as it gets on.
STALL_TIMEOUT_S = 120.0
ADJUSTMENT_TIMEOUT_S = 900.0
# After Ctrl-C, the time in which frames that are already in the pipeline may still be tracked.
DRAIN_TIMEOUT_S = 3.0
# After Ctrl-C a recording camera ends its stream and writes what it has to the disk.
RECORDER_STOP_TIMEOUT_S = 60.0
MAP_WRITER_STOP_TIMEOUT_S = 5.0
# A run ends its stack in order, which may have to wait for a long step.
EXPERIMENT_STOP_TIMEOUT_S = 20.0
# A stage, which reports twice a second, is missed after this long.
SILENT_STAGE_S = 3.0
# A stack without any status for this long has ended.
SILENT_STACK_S = 5.0

# --- Time-outs of supervised processes ----------------------------------------------------------------------------
# The wait before a restart, doubled with each failure in a row.
FIRST_BACK_OFF_S = 0.1
LONGEST_BACK_OFF_S = 5.0
# A process with ready = "started" is ready when it has lived this long: one that fails at once never was.
SETTLED_AFTER_S = 0.3
# After this long, a failure counts as the first one again.
STABLE_AFTER_S = 10.0
KILL_TIMEOUT_S = 5.0
# The state of another deputy's processes is unknown when it is older than this.
REMOTE_STATE_TIMEOUT_S = 5.0
# A deputy or sheriff whose loop takes longer was itself suspended (Ctrl-Z) or did not get the processor.
LONGEST_TURN_S = 1.0

# --- Time-outs between sheriff and deputies -----------------------------------------------------------------------
# Somewhat more than DEPUTY_STATUS_PERIOD_S: every deputy is heard once.
DISCOVERY_S = 1.3
DUPLICATE_DEPUTY_S = 1.5
SILENT_DEPUTY_S = 3.5
FIND_DEPUTY_TIMEOUT_S = 5.0
# LCM's self-test on the deputy's side may take 10 s.
ORDER_TIMEOUT_S = 15.0
# A deputy that in this time counts orders with unknown keys, and obeys none, counts ours.
DISTRUST_TIMEOUT_S = 3.0
TAIL_TIMEOUT_S = 5.0

# --- Faults of `tessera experiment faults` ------------------------------------------------------------------------
FAULT_KINDS = ("kill", "stop", "slow", "loss")
# Of a run, those that can be killed and stopped; "extractor" stands for all of them.
FAULT_PROCESSES = (
    "camera",
    "dispatcher",
    "extractor",
    "reassembler",
    "tracker",
    "mapper",
    "loop_closer",
    "global_adjuster",
    "evaluator",
)
