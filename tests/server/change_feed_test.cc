#include "server/change_feed.h"

#include <gtest/gtest.h>

#include <chrono>
#include <cstdint>
#include <memory>
#include <utility>

#include "tests/server/keeper_fakes.h"
#include "tests/server/keeper_messages.h"
#include "tests/server/sample_map.h"

namespace fathom::server {
namespace {

// Counts how often it was woken.
class Sleeper final : public Watcher {
 public:
  void Wake() override {
    MutexLock lock(mutex_);
    woken_ += 1;
    changed_.NotifyAll();
  }
  // Waits until the log's view has reached `revision`; false if the test would
  // wait for ever.
  bool AwaitRevision(const ChangeLog& log, uint64_t revision) {
    MutexLock lock(mutex_);
    while (log.view()->revision() < revision) {
      if (!changed_.WaitFor(mutex_, std::chrono::seconds(60))) return false;
    }
    return true;
  }
  int woken() {
    MutexLock lock(mutex_);
    return woken_;
  }

 private:
  Mutex mutex_;
  CondVar changed_;
  int woken_ FATHOM_GUARDED_BY(mutex_) = 0;
};

struct Kept {
  FakeStore store;
  MapKeeper keeper{{.map = std::make_unique<map::ObstacleMap>(SampleOptions()),
                    .checkpoint = nullptr,
                    .ledger = {},
                    .journal_records = 0,
                    .damage = {}},
                   store,
                   {}};

  uint64_t Revision() { return keeper.View()->revision(); }
  void Report(uint64_t sequence) {
    auto listener = std::make_shared<FakeListener>();
    ASSERT_TRUE(keeper.Submit(FixMessage(sequence, "ship"), listener).ok());
    listener->AwaitApplied(1);
  }
};

TEST(ChangeFeed, WakesWatchersWhenTheMapHasChanged) {
  Kept kept;
  ChangeFeed feed(kept.keeper);
  const auto sleeper = std::make_shared<Sleeper>();
  feed.Add(sleeper);
  const ChangeNumber seen = ChangeNumber::After(feed.log().view()->revision());
  for (uint64_t n = 1; n <= 5; ++n) {
    kept.Report(n);
    ASSERT_TRUE(sleeper->AwaitRevision(feed.log(), kept.Revision()));
  }
  EXPECT_GE(sleeper->woken(), 5);
  int changed = 0;
  const auto read = feed.log().ReadContacts(seen, [&](uint32_t) { ++changed; });
  EXPECT_FALSE(read.lost);
  EXPECT_EQ(changed, 1);
}

// The log still followed the map for the one before and lagged by an interval:
// who resumed a watch was told of changes one by one that he could have been
// told of in one.
TEST(ChangeFeed, WhoeverJoinsFindsTheMapAsItIs) {
  Kept kept;
  ChangeFeed feed(kept.keeper, {.interval = std::chrono::hours(1)});
  const auto first = std::make_shared<Sleeper>();
  feed.Add(first);
  kept.Report(1);
  ASSERT_TRUE(first->AwaitRevision(feed.log(), kept.Revision()));
  // From here on the feed's thread sleeps for an hour.
  kept.Report(2);
  const auto second = std::make_shared<Sleeper>();
  feed.Add(second);
  EXPECT_EQ(feed.log().view()->revision(), kept.Revision());
}

TEST(ChangeFeed, WithNobodyWatchingItHoldsNoViewAndForgets) {
  Kept kept;
  ChangeFeed feed(kept.keeper, {.linger = std::chrono::milliseconds(0)});
  auto sleeper = std::make_shared<Sleeper>();
  feed.Add(sleeper);
  sleeper.reset();
  while (feed.log().view() != nullptr) {
  }
  kept.Report(1);
  sleeper = std::make_shared<Sleeper>();
  feed.Add(sleeper);
  EXPECT_EQ(feed.log().view()->revision(), kept.Revision());
  // What was before is lost to one who resumes.
  EXPECT_TRUE(feed.log().ReadContacts({}, [](uint32_t) {}).lost);
}

}  // namespace
}  // namespace fathom::server
