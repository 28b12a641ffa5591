// Readers on views while the writer goes on: for ThreadSanitizer, and for the
// promise that a view never changes under its reader.

#include <gtest/gtest.h>

#include <atomic>
#include <cmath>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "map/contacts/contact_map.h"
#include "tests/map/contacts/contact_testing.h"

namespace fathom::map {
namespace {

TEST(ContactsView, IsReadWhileTheMapIsWritten) {
  constexpr int kContacts = 200;
  constexpr int kRounds = 150;
  ContactMap map(ContactMapOptions{});
  std::mutex mutex;
  ContactsView published;
  std::atomic<bool> done = false;

  const auto read = [&] {
    int round = 0;
    while (!done.load()) {
      ContactsView view;
      {
        const std::scoped_lock lock(mutex);
        view = published;
      }
      const Time t = AtS(10.0 * (round++ % (kRounds + 20)));
      int near = 0;
      view.ForEachNear(kBay, 5000, t, [&](const NearContact& contact) {
        ++near;
        EXPECT_TRUE(std::isfinite(contact.north_m));
      });
      view.ForEach([&](const Contact& contact) {
        // Reads every slot of the history that the view holds, twice: what
        // the writer fills meanwhile lies behind them.
        const std::size_t size = contact.history().size();
        double sum = 0;
        for (std::size_t i = 0; i < size; ++i) {
          sum += contact.history()[i].x(2);
        }
        EXPECT_EQ(contact.history().size(), size);
        EXPECT_EQ(sum, 3.0 * static_cast<double>(size));
      });
    }
  };
  std::vector<std::thread> readers;
  for (int i = 0; i < 3; ++i) readers.emplace_back(read);
  for (int round = 0; round < kRounds; ++round) {
    for (int i = 0; i < kContacts; ++i) {
      // Some are quiet in most rounds, so that blocks hold old and new.
      if (i % 3 != 0 && round % 7 != 0) continue;
      map.Apply(
          Fix(std::to_string(i), 10 * round, Direct(kBay, i, 40.0 * i), 3, 0));
    }
    if (round % 10 == 9) map.Drop(Key("5"), AtS(10 * round));
    const ContactsView view = map.View();
    const std::scoped_lock lock(mutex);
    published = view;
  }
  done = true;
  for (std::thread& reader : readers) reader.join();
  EXPECT_EQ(map.View().size(), static_cast<std::size_t>(kContacts));
}

}  // namespace
}  // namespace fathom::map
