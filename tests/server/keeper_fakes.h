// A mission store that a test can hold, fill up or break, and a listener that
// remembers what it was told. Both thread-safe; waiting is for a condition,
// never for a time (a test that would wait for ever runs into its timeout).

#ifndef FATHOM_TESTS_SERVER_KEEPER_FAKES_H_
#define FATHOM_TESTS_SERVER_KEEPER_FAKES_H_

#include <cstddef>
#include <string>
#include <utility>
#include <vector>

#include "absl/status/status.h"
#include "base/mutex.h"
#include "server/ingest.h"
#include "server/map_keeper.h"
#include "server/mission_store.h"

namespace fathom::server {

// What one Commit got.
struct SeenBatch {
  size_t journal = 0;
  size_t positions = 0;
  size_t history = 0;
  bool checkpoint = false;
};

class FakeStore final : public MissionStore {
 public:
  absl::Status Commit(const storage::Batch& batch) override {
    MutexLock lock(mutex_);
    attempts_ += 1;
    changed_.NotifyAll();
    while (held_) changed_.Wait(mutex_);
    if (!failure_.ok() && seen_.size() >= fail_from_) return failure_;
    seen_.push_back({.journal = batch.journal.size(),
                     .positions = batch.source_positions.size(),
                     .history = batch.contact_history.size(),
                     .checkpoint = batch.checkpoint.has_value()});
    return absl::OkStatus();
  }

  // Commits wait inside until Release.
  void Hold() {
    MutexLock lock(mutex_);
    held_ = true;
  }
  void Release() {
    MutexLock lock(mutex_);
    held_ = false;
    changed_.NotifyAll();
  }
  // Every commit fails so, once there were `from` good ones, until
  // Fail(OkStatus()).
  void Fail(absl::Status status, size_t from = 0) {
    MutexLock lock(mutex_);
    failure_ = std::move(status);
    fail_from_ = from;
  }
  // Waits until Commit was called `count` times in all.
  void AwaitAttempts(size_t count) {
    MutexLock lock(mutex_);
    while (attempts_ < count) changed_.Wait(mutex_);
  }
  std::vector<SeenBatch> seen() {
    MutexLock lock(mutex_);
    return seen_;
  }

 private:
  Mutex mutex_;
  CondVar changed_;
  bool held_ FATHOM_GUARDED_BY(mutex_) = false;
  size_t attempts_ FATHOM_GUARDED_BY(mutex_) = 0;
  absl::Status failure_ FATHOM_GUARDED_BY(mutex_);
  size_t fail_from_ FATHOM_GUARDED_BY(mutex_) = 0;
  std::vector<SeenBatch> seen_ FATHOM_GUARDED_BY(mutex_);
};

class FakeListener final : public IngestListener {
 public:
  void OnApplied(const MessageOutcome& outcome) override {
    MutexLock lock(mutex_);
    outcomes_.push_back(outcome);
    changed_.NotifyAll();
  }
  void OnDurable(MessageNumber newest, size_t count) override {
    MutexLock lock(mutex_);
    newest_ = newest;
    durable_ += count;
    changed_.NotifyAll();
  }
  void OnRoom() override {
    MutexLock lock(mutex_);
    rooms_ += 1;
    changed_.NotifyAll();
  }
  void OnFault() override {
    MutexLock lock(mutex_);
    faults_ += 1;
    changed_.NotifyAll();
  }

  std::vector<MessageOutcome> AwaitApplied(size_t count) {
    MutexLock lock(mutex_);
    while (outcomes_.size() < count) changed_.Wait(mutex_);
    return outcomes_;
  }
  MessageNumber AwaitDurable(size_t count) {
    MutexLock lock(mutex_);
    while (durable_ < count) changed_.Wait(mutex_);
    return newest_;
  }
  void AwaitRooms(size_t count) {
    MutexLock lock(mutex_);
    while (rooms_ < count) changed_.Wait(mutex_);
  }
  void AwaitFaults(size_t count) {
    MutexLock lock(mutex_);
    while (faults_ < count) changed_.Wait(mutex_);
  }
  size_t durable() {
    MutexLock lock(mutex_);
    return durable_;
  }
  size_t rooms() {
    MutexLock lock(mutex_);
    return rooms_;
  }

 private:
  Mutex mutex_;
  CondVar changed_;
  std::vector<MessageOutcome> outcomes_ FATHOM_GUARDED_BY(mutex_);
  MessageNumber newest_ FATHOM_GUARDED_BY(mutex_);
  size_t durable_ FATHOM_GUARDED_BY(mutex_) = 0;
  size_t rooms_ FATHOM_GUARDED_BY(mutex_) = 0;
  size_t faults_ FATHOM_GUARDED_BY(mutex_) = 0;
};

// The result of a command: Done() is what the keeper gets, Await() what it
// told.
template <typename Result>
class Awaited {
 public:
  using Value = absl::StatusOr<Applied<Result>>;

  server::Done<Result> Done() {
    return [this](Value value) {
      // A status of our own: its shared representation is released inside
      // Debian's Abseil, where ThreadSanitizer cannot see the order.
      if (!value.ok()) {
        value = absl::Status(value.status().code(),
                             std::string(value.status().message()));
      }
      MutexLock lock(mutex_);
      told_.push_back(std::move(value));
      changed_.NotifyAll();
    };
  }
  Value Await() {
    MutexLock lock(mutex_);
    while (told_.empty()) changed_.Wait(mutex_);
    return told_.front();
  }
  size_t times_told() {
    MutexLock lock(mutex_);
    return told_.size();
  }

 private:
  Mutex mutex_;
  CondVar changed_;
  std::vector<Value> told_ FATHOM_GUARDED_BY(mutex_);
};

}  // namespace fathom::server

#endif  // FATHOM_TESTS_SERVER_KEEPER_FAKES_H_
