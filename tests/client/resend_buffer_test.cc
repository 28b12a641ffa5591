#include "client/resend_buffer.h"

#include <gtest/gtest.h>

#include <string>

namespace fathom::client {
namespace {

TEST(ResendBuffer, NumbersFromTheFirstSequence) {
  ResendBuffer<std::string> buffer(5, 10, 100);
  EXPECT_EQ(buffer.last_sequence(), 4u);
  EXPECT_EQ(buffer.Push("e", 1), 5u);
  EXPECT_EQ(buffer.Push("f", 1), 6u);
}

TEST(ResendBuffer, RewindWritesAgainWhatIsNotDurable) {
  ResendBuffer<std::string> buffer(1, 10, 100);
  for (const char* message : {"a", "b", "c"}) buffer.Push(message, 1);
  EXPECT_EQ(buffer.NextToWrite(), "a");
  EXPECT_EQ(buffer.NextToWrite(), "b");
  buffer.AckDurable(1);
  buffer.Rewind();
  EXPECT_EQ(buffer.NextToWrite(), "b");
  EXPECT_EQ(buffer.NextToWrite(), "c");
  EXPECT_FALSE(buffer.HasUnwritten());
}

TEST(ResendBuffer, AckBetweenWritesKeepsThePlace) {
  ResendBuffer<std::string> buffer(1, 10, 100);
  for (const char* message : {"a", "b", "c"}) buffer.Push(message, 1);
  buffer.NextToWrite();
  buffer.AckDurable(1);
  EXPECT_EQ(buffer.NextToWrite(), "b");
  // A server that knew more than was written on this connection.
  buffer.Rewind();
  buffer.AckDurable(2);
  EXPECT_EQ(buffer.NextToWrite(), "c");
}

TEST(ResendBuffer, RoomEndsAtTheMessageAndAtTheByteLimit) {
  ResendBuffer<std::string> buffer(1, 2, 100);
  buffer.Push("a", 99);
  EXPECT_TRUE(buffer.HasRoom(1));
  EXPECT_FALSE(buffer.HasRoom(2));
  buffer.Push("b", 1);
  EXPECT_FALSE(buffer.HasRoom(0));
  buffer.AckDurable(1);
  EXPECT_TRUE(buffer.HasRoom(99));
  EXPECT_FALSE(buffer.HasRoom(100));
  // One message alone always fits.
  buffer.AckDurable(2);
  EXPECT_TRUE(buffer.HasRoom(1000));
}

TEST(ResendBuffer, AcksOfNumbersNeverPushedAreClamped) {
  ResendBuffer<std::string> buffer(1, 10, 100);
  buffer.Push("a", 1);
  buffer.AckDurable(1000);
  EXPECT_EQ(buffer.durable_sequence(), 1u);
  EXPECT_EQ(buffer.bytes(), 0u);
  EXPECT_EQ(buffer.Push("b", 1), 2u);
  buffer.AckDurable(0);
  EXPECT_EQ(buffer.durable_sequence(), 1u);
}

}  // namespace
}  // namespace fathom::client
