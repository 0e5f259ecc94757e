// A V4L2 camera for machines whose kernel has none: preloaded, it is /dev/video0 to the process, down to the system
// calls. 640x480 BGR at 10 Hz: two walls of squares pass by. While the file $FAKE_V4L2_UNPLUGGED is there, it is
// unplugged.
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <linux/videodev2.h>
#include <stdarg.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/timerfd.h>
#include <time.h>
#include <unistd.h>

enum { kWidth = 640, kHeight = 480, kBytes = 3 * kWidth * kHeight, kInterval_ns = 100000000, kMaxBuffers = 4 };

static int device = -1;  // a timer, readable when an image is there
static unsigned char* buffers[kMaxBuffers];
static unsigned queue[kMaxBuffers], queue_begin, queue_end;  // of buffers that may be filled

static int IsUnplugged(void) {
  const char* path = getenv("FAKE_V4L2_UNPLUGGED");
  return path != NULL && access(path, F_OK) == 0;
}

static int OpenDevice(void) {
  if (IsUnplugged()) {
    errno = ENODEV;
    return -1;
  }
  const struct itimerspec ticks = {{0, kInterval_ns}, {0, kInterval_ns}};
  device = timerfd_create(CLOCK_MONOTONIC, TFD_NONBLOCK);
  timerfd_settime(device, 0, &ticks, NULL);
  return device;
}

#define DEFINE_OPEN(name)                                                      \
  int name(const char* path, int flags, ...) {                                 \
    va_list arguments;                                                         \
    va_start(arguments, flags);                                                \
    const int mode = va_arg(arguments, int);                                   \
    va_end(arguments);                                                         \
    if (path != NULL && strcmp(path, "/dev/video0") == 0) return OpenDevice(); \
    int (*real)(const char*, int, ...) = dlsym(RTLD_NEXT, #name);              \
    return real(path, flags, mode);                                            \
  }
DEFINE_OPEN(open)
DEFINE_OPEN(open64)

#define DEFINE_MMAP(name)                                                                \
  void* name(void* at, size_t size, int protection, int flags, int file, off_t offset) { \
    if (file >= 0 && file == device) return buffers[offset] = calloc(1, size);           \
    void* (*real)(void*, size_t, int, int, int, off_t) = dlsym(RTLD_NEXT, #name);        \
    return real(at, size, protection, flags, file, offset);                              \
  }
DEFINE_MMAP(mmap)
DEFINE_MMAP(mmap64)

int munmap(void* at, size_t size) {
  for (int i = 0; i < kMaxBuffers; ++i) {
    if (at == NULL || at != buffers[i]) continue;
    free(at);
    buffers[i] = NULL;
    return 0;
  }
  int (*real)(void*, size_t) = dlsym(RTLD_NEXT, "munmap");
  return real(at, size);
}

int close(int file) {
  if (file == device) device = -1;
  int (*real)(int) = dlsym(RTLD_NEXT, "close");
  return real(file);
}

static void Draw(unsigned char* image, int64_t step) {
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      const int64_t column = x + (y < kHeight / 2 ? 2 : 4) * step;
      uint32_t hash = (uint32_t)(column / 9) * 2654435761u ^ (uint32_t)(y / 9) * 3266489917u;
      hash = (hash ^ hash >> 15) * 2246822519u;
      memset(image + 3 * (y * kWidth + x), (int)(hash >> 13 & 255), 3);
    }
  }
}

static int Fill(struct v4l2_buffer* buffer) {
  uint64_t num_ticks;
  if (read(device, &num_ticks, sizeof num_ticks) != sizeof num_ticks || queue_begin == queue_end) {
    errno = EAGAIN;
    return -1;
  }
  struct timespec now;
  clock_gettime(CLOCK_MONOTONIC, &now);
  buffer->index = queue[queue_begin++ % kMaxBuffers];
  buffer->bytesused = buffer->length = kBytes;
  buffer->flags = V4L2_BUF_FLAG_TIMESTAMP_MONOTONIC;
  buffer->timestamp.tv_sec = now.tv_sec;
  buffer->timestamp.tv_usec = now.tv_nsec / 1000;
  Draw(buffers[buffer->index], 10 * now.tv_sec + now.tv_nsec / kInterval_ns);
  return 0;
}

static int Answer(unsigned long request, void* argument) {
  struct v4l2_buffer* buffer = argument;
  switch (request) {
    case VIDIOC_QUERYCAP: {
      struct v4l2_capability* capability = argument;
      strcpy((char*)capability->driver, "fake");
      capability->capabilities = capability->device_caps = V4L2_CAP_VIDEO_CAPTURE | V4L2_CAP_STREAMING;
      return 0;
    }
    case VIDIOC_S_FMT:
    case VIDIOC_G_FMT:
    case VIDIOC_TRY_FMT: {
      struct v4l2_pix_format* format = &((struct v4l2_format*)argument)->fmt.pix;
      *format = (struct v4l2_pix_format){.width = kWidth,
                                         .height = kHeight,
                                         .pixelformat = V4L2_PIX_FMT_BGR24,
                                         .field = V4L2_FIELD_NONE,
                                         .bytesperline = 3 * kWidth,
                                         .sizeimage = kBytes};
      return 0;
    }
    case VIDIOC_G_PARM:
    case VIDIOC_S_PARM:
      ((struct v4l2_streamparm*)argument)->parm.capture.timeperframe = (struct v4l2_fract){1, 10};
      return 0;
    case VIDIOC_REQBUFS: {
      struct v4l2_requestbuffers* wanted = argument;
      if (wanted->count > kMaxBuffers) wanted->count = kMaxBuffers;
      queue_begin = queue_end = 0;
      return 0;
    }
    case VIDIOC_QUERYBUF:
      buffer->length = kBytes;
      buffer->m.offset = buffer->index;
      return 0;
    case VIDIOC_QBUF:
      queue[queue_end++ % kMaxBuffers] = buffer->index;
      return 0;
    case VIDIOC_DQBUF:
      return Fill(buffer);
    case VIDIOC_STREAMON:
    case VIDIOC_STREAMOFF:
      return 0;
    default:
      errno = EINVAL;
      return -1;
  }
}

int ioctl(int file, unsigned long request, ...) {
  va_list arguments;
  va_start(arguments, request);
  void* argument = va_arg(arguments, void*);
  va_end(arguments);
  if (file < 0 || file != device) {
    int (*real)(int, unsigned long, ...) = dlsym(RTLD_NEXT, "ioctl");
    return real(file, request, argument);
  }
  if (IsUnplugged()) {
    errno = ENODEV;
    return -1;
  }
  return Answer(request, argument);
}
