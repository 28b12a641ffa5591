#include "map/geodesy/ids.h"

#include <gtest/gtest.h>

#include <type_traits>
#include <unordered_set>

#include "absl/hash/hash.h"

namespace fathom::map {
namespace {

// A swap of source and contact must not compile.
static_assert(!std::is_convertible_v<SourceId, ContactId>);
static_assert(!std::is_constructible_v<ContactKey, ContactId, SourceId>);

TEST(StringId, OrdersByBytes) {
  EXPECT_LT(SourceId{"a"}, SourceId{"b"});
  EXPECT_LT(SourceId{"B"}, SourceId{"a"});
  EXPECT_EQ(SourceId{"a"}, SourceId{"a"});
  EXPECT_TRUE(SourceId{}.empty());
}

TEST(ContactKey, OrdersBySourceThenContact) {
  const ContactKey first = {SourceId{"a"}, ContactId{"9"}};
  const ContactKey second = {SourceId{"b"}, ContactId{"1"}};
  EXPECT_LT(first, second);
}

TEST(ContactKey, HashTellsSwappedNamesApart) {
  const ContactKey ab = {SourceId{"a"}, ContactId{"b"}};
  const ContactKey ba = {SourceId{"b"}, ContactId{"a"}};
  EXPECT_NE(std::hash<ContactKey>()(ab), std::hash<ContactKey>()(ba));
  EXPECT_NE(absl::HashOf(ab), absl::HashOf(ba));
  const std::unordered_set<ContactKey> keys = {ab, ba, ab};
  EXPECT_EQ(keys.size(), 2u);
}

}  // namespace
}  // namespace fathom::map
