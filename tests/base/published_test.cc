#include "base/published.h"

#include <gtest/gtest.h>

#include <atomic>
#include <memory>
#include <thread>
#include <utility>
#include <vector>

namespace fathom {
namespace {

// Remembers which thread freed it.
struct Piece {
  Piece(int n, std::atomic<int>* counter, std::thread::id owner)
      : number(n), freed_by_readers(counter), publisher(owner) {}
  Piece(const Piece&) = delete;
  Piece& operator=(const Piece&) = delete;
  ~Piece() {
    if (std::this_thread::get_id() != publisher) *freed_by_readers += 1;
  }

  int number;
  std::atomic<int>* freed_by_readers;
  std::thread::id publisher;
};

TEST(Published, GivesTheNewestAndNullBeforeTheFirst) {
  Published<int> numbers;
  EXPECT_EQ(numbers.Get(), nullptr);
  numbers.Publish(std::make_shared<const int>(1));
  numbers.Publish(std::make_shared<const int>(2));
  ASSERT_NE(numbers.Get(), nullptr);
  EXPECT_EQ(*numbers.Get(), 2);
}

TEST(Published, KeepsWhatIsReadAndFreesTheRest) {
  Published<int> numbers;
  numbers.Publish(std::make_shared<const int>(0));
  const std::shared_ptr<const int> read = numbers.Get();
  for (int i = 1; i <= 100; ++i) {
    numbers.Publish(std::make_shared<const int>(i));
    EXPECT_EQ(*read, 0);
    // What is read and the one replaced last.
    EXPECT_LE(numbers.replaced(), 2U);
  }
}

TEST(Published, AnObjectThatNobodyReadsIsFreedByTheNextCall) {
  Published<int> numbers;
  auto first = std::make_shared<const int>(1);
  const std::weak_ptr<const int> seen = first;
  numbers.Publish(std::move(first));
  numbers.Publish(std::make_shared<const int>(2));
  numbers.Publish(std::make_shared<const int>(3));
  EXPECT_TRUE(seen.expired());
}

TEST(Published, ReadersNeverFree) {
  std::atomic<int> freed_by_readers = 0;
  {
    Published<Piece> pieces;
    const std::thread::id self = std::this_thread::get_id();
    pieces.Publish(std::make_shared<Piece>(0, &freed_by_readers, self));
    std::atomic<bool> done = false;
    std::vector<std::thread> readers;
    for (int i = 0; i < 3; ++i) {
      readers.emplace_back([&] {
        int last = 0;
        while (!done) {
          const std::shared_ptr<const Piece> piece = pieces.Get();
          EXPECT_GE(piece->number, last);
          last = piece->number;
        }
      });
    }
    for (int i = 1; i <= 20000; ++i) {
      pieces.Publish(std::make_shared<Piece>(i, &freed_by_readers, self));
    }
    done = true;
    for (std::thread& reader : readers) reader.join();
    // One for each reader at most, and the last replaced.
    EXPECT_LE(pieces.replaced(), 4U);
  }
  EXPECT_EQ(freed_by_readers, 0);
}

}  // namespace
}  // namespace fathom
