// A disk that fails: while one of these lives, fdatasync fails (EIO) for the
// whole program, whose own fdatasync stands before the C library's.

#ifndef FATHOM_TESTS_CLIENT_FAILING_SYNC_H_
#define FATHOM_TESTS_CLIENT_FAILING_SYNC_H_

namespace fathom::client {

class FailingSync {
 public:
  FailingSync();
  ~FailingSync();
  FailingSync(const FailingSync&) = delete;
  FailingSync& operator=(const FailingSync&) = delete;
};

}  // namespace fathom::client

#endif  // FATHOM_TESTS_CLIENT_FAILING_SYNC_H_
