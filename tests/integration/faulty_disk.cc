// A disk that refuses when it is told to: loaded before the C library
// (LD_PRELOAD) of a live fathomd, so that the server itself needs no test door.
//
// FATHOM_FAULT_FILE names a file; while its first letter is
//   f  writes find no room (ENOSPC)
//   s  fsync and fdatasync fail (EIO)
// of mission files (".fathom" in the name), those calls fail.

#include <fcntl.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <cerrno>
#include <climits>
#include <cstdio>
#include <cstdlib>
#include <cstring>

namespace {

char Fault() {
  const char* const name = std::getenv("FATHOM_FAULT_FILE");
  if (name == nullptr) return ' ';
  const long file = syscall(SYS_openat, AT_FDCWD, name, O_RDONLY | O_CLOEXEC);
  if (file < 0) return ' ';
  char letter = ' ';
  if (syscall(SYS_read, file, &letter, 1) != 1) letter = ' ';
  syscall(SYS_close, file);
  return letter;
}

bool IsMission(int descriptor) {
  char link[64];
  char path[PATH_MAX];
  std::snprintf(link, sizeof(link), "/proc/self/fd/%d", descriptor);
  const ssize_t size = readlink(link, path, sizeof(path) - 1);
  if (size <= 0) return false;
  path[size] = '\0';
  return std::strstr(path, ".fathom") != nullptr;
}

int Sync(int descriptor, long number) {
  if (IsMission(descriptor) && Fault() == 's') {
    errno = EIO;
    return -1;
  }
  return static_cast<int>(syscall(number, descriptor));
}

ssize_t Write(int descriptor, const void* bytes, size_t size, off64_t offset) {
  if (IsMission(descriptor) && Fault() == 'f') {
    errno = ENOSPC;
    return -1;
  }
  return syscall(SYS_pwrite64, descriptor, bytes, size, offset);
}

}  // namespace

extern "C" {
int fsync(int descriptor) { return Sync(descriptor, SYS_fsync); }
int fdatasync(int descriptor) { return Sync(descriptor, SYS_fdatasync); }
ssize_t pwrite(int descriptor, const void* bytes, size_t size, off_t offset) {
  return Write(descriptor, bytes, size, offset);
}
ssize_t pwrite64(int descriptor, const void* bytes, size_t size,
                 off64_t offset) {
  return Write(descriptor, bytes, size, offset);
}
}
