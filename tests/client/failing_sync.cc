#include "tests/client/failing_sync.h"

#include <sys/syscall.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <utility>

namespace fathom::client {
namespace {

std::atomic<bool> failing = false;
std::atomic<const std::function<void()>*> during = nullptr;

}  // namespace

FailingSync::FailingSync() { failing = true; }
FailingSync::~FailingSync() { failing = false; }

DuringSync::DuringSync(std::function<void()> work) : work_(std::move(work)) {
  during = &work_;
}
DuringSync::~DuringSync() { during = nullptr; }

}  // namespace fathom::client

extern "C" int fdatasync(int descriptor) {
  if (const auto* const work = fathom::client::during.exchange(nullptr)) {
    (*work)();
  }
  if (!fathom::client::failing) {
    return static_cast<int>(::syscall(SYS_fdatasync, descriptor));
  }
  errno = EIO;
  return -1;
}
