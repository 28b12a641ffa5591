#include "server/change_feed.h"

#include <random>
#include <utility>

namespace fathom::server {
namespace {

// How long the thread waits for a view before it looks whether it should end
// or wake somebody.
constexpr std::chrono::milliseconds kTick{10};

uint64_t RandomRun() {
  std::random_device device;
  uint64_t run = 0;
  while (run == 0) run = uint64_t{device()} << 32 | device();
  return run;
}

}  // namespace

ChangeFeed::ChangeFeed(const MapKeeper& keeper, ChangeFeedOptions options)
    : keeper_(keeper),
      options_(options),
      log_(RandomRun(), options.log),
      thread_([this] { Run(); }) {}

ChangeFeed::~ChangeFeed() {
  {
    MutexLock lock(mutex_);
    closed_ = true;
    changed_.NotifyAll();
  }
  thread_.join();
}

void ChangeFeed::Add(const std::shared_ptr<Watcher>& watcher) {
  MutexLock lock(mutex_);
  if (following_) {
    log_.Show(keeper_.View());
    // The thread may not find it new, and the others are to hear of it.
    soon_ = true;
  } else {
    following_ = true;
    log_.Restart(keeper_.View());
  }
  last_wanted_ = std::chrono::steady_clock::now();
  watchers_.push_back(watcher);
  changed_.NotifyAll();
}

void ChangeFeed::WakeAll() {
  std::vector<std::weak_ptr<Watcher>> watchers;
  {
    MutexLock lock(mutex_);
    std::erase_if(watchers_, [](const auto& open) { return open.expired(); });
    watchers = watchers_;
  }
  for (const auto& open : watchers) {
    if (const auto watcher = open.lock()) watcher->Wake();
  }
}

void ChangeFeed::WakeSoon() {
  MutexLock lock(mutex_);
  soon_ = true;
}

bool ChangeFeed::Wanted(SteadyTime now) {
  for (const auto& watcher : watchers_) {
    if (!watcher.expired()) last_wanted_ = now;
  }
  return now - last_wanted_ < options_.linger;
}

void ChangeFeed::Run() {
  SteadyTime woken{};
  while (true) {
    {
      MutexLock lock(mutex_);
      if (following_ && !Wanted(std::chrono::steady_clock::now())) {
        following_ = false;
        log_.Rest();
      }
      while (!following_ && !closed_) changed_.Wait(mutex_);
      if (closed_) return;
    }
    const uint64_t shown = log_.view()->revision();
    SteadyTime now = std::chrono::steady_clock::now();
    const auto view = keeper_.NextView(shown, now + kTick);
    const bool changed = view->revision() > shown;
    bool soon = false;
    {
      MutexLock lock(mutex_);
      log_.Show(view);
      std::swap(soon, soon_);
    }
    now = std::chrono::steady_clock::now();
    if (!changed && !soon && now - woken < kWatchProgressInterval) continue;
    woken = now;
    WakeAll();
    if (!changed) continue;
    const SteadyTime next = now + options_.interval;
    MutexLock lock(mutex_);
    while (!closed_ && changed_.WaitUntil(mutex_, next)) {
    }
  }
}

}  // namespace fathom::server
