#include "tests/client/failing_sync.h"

#include <sys/syscall.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>

namespace fathom::client {
namespace {

std::atomic<bool> failing = false;

}  // namespace

FailingSync::FailingSync() { failing = true; }
FailingSync::~FailingSync() { failing = false; }

}  // namespace fathom::client

extern "C" int fdatasync(int descriptor) {
  if (!fathom::client::failing) {
    return static_cast<int>(::syscall(SYS_fdatasync, descriptor));
  }
  errno = EIO;
  return -1;
}
