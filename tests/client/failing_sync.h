// The program's own fdatasync, which stands before the C library's: a disk that
// fails, and one that takes its time.

#ifndef FATHOM_TESTS_CLIENT_FAILING_SYNC_H_
#define FATHOM_TESTS_CLIENT_FAILING_SYNC_H_

#include <functional>

namespace fathom::client {

// While one of these lives, fdatasync fails (EIO) for the whole program.
class FailingSync {
 public:
  FailingSync();
  ~FailingSync();
  FailingSync(const FailingSync&) = delete;
  FailingSync& operator=(const FailingSync&) = delete;
};

// The next fdatasync calls `work` before it syncs.
class DuringSync {
 public:
  explicit DuringSync(std::function<void()> work);
  ~DuringSync();
  DuringSync(const DuringSync&) = delete;
  DuringSync& operator=(const DuringSync&) = delete;

 private:
  const std::function<void()> work_;
};

}  // namespace fathom::client

#endif  // FATHOM_TESTS_CLIENT_FAILING_SYNC_H_
