#include "map/contacts/spatial_index.h"

#include <gtest/gtest.h>

#include <string>
#include <utility>
#include <vector>

#include "tests/map/contacts/contact_testing.h"

namespace fathom::map {
namespace {

// Names of the contacts that may be within 100 m of kBay.
std::vector<std::string> Candidates(const SpatialIndex& index) {
  std::vector<std::string> names;
  index.ForEachCandidate(kBay, 100, AtS(0), [&](const Contact& contact) {
    names.push_back(contact.key().contact.value);
  });
  return names;
}

TEST(SpatialIndex, OneThatWasMovedFromIsEmptyAndCanBeFilledAgain) {
  const Contact one(Key("a"));
  const Contact other(Key("b"));
  SpatialBounds here;
  here.low = here.high = ToUnitVector(kBay);
  here.least_wander_m_s15 = 0;
  here.radius_m = 10;
  here.oldest = here.newest = AtS(0);
  SpatialIndex index;
  index.Insert({.contact = &one, .code = 1, .bounds = here}, /*epoch=*/1);
  index.Settle();
  SpatialIndex taken = std::move(index);
  EXPECT_EQ(Candidates(taken), std::vector<std::string>{"a"});
  // NOLINTNEXTLINE(bugprone-use-after-move): what it is about.
  EXPECT_TRUE(Candidates(index).empty());
  index.Insert({.contact = &other, .code = 1, .bounds = here}, /*epoch=*/2);
  index.Settle();
  EXPECT_EQ(Candidates(index), std::vector<std::string>{"b"});
  EXPECT_EQ(Candidates(taken), std::vector<std::string>{"a"});
}

}  // namespace
}  // namespace fathom::map
