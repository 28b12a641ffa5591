#include "server/change_order.h"

#include <gtest/gtest.h>

#include <array>
#include <random>
#include <string>
#include <vector>

#include "server/geo_box.h"

namespace fathom::server {
namespace {

using Order = ChangeOrder<int, char>;

std::string After(const Order& order, ChangeNumber seen) {
  std::string text;
  order.ForEachAfter(
      seen, [&](int key, char place) { text += std::to_string(key) + place; });
  return text;
}

void Enter(Order& order, int key, uint64_t revision) {
  order.Enter(key, revision, [key] { return static_cast<char>('a' + key); });
}

TEST(ChangeOrder, AKeyIsThereOnceInTheOrderOfItsLastChange) {
  Order order(10);
  order.Restart(5);
  Enter(order, 1, 6);
  Enter(order, 2, 6);
  Enter(order, 3, 7);
  EXPECT_EQ(After(order, ChangeNumber::After(5)), "1b2c3d");
  EXPECT_EQ(After(order, ChangeNumber::After(6)), "3d");
  Enter(order, 1, 8);
  EXPECT_EQ(After(order, ChangeNumber::After(5)), "2c3d1b");
  EXPECT_FALSE(order.Lost(ChangeNumber::After(5)));
  EXPECT_TRUE(order.Lost(ChangeNumber::After(4)));
  EXPECT_TRUE(order.Lost({}));
}

TEST(ChangeOrder, OnePastTheBoundTheLongestUnchangedIsLost) {
  Order order(3);
  order.Restart(0);
  Enter(order, 1, 1);
  Enter(order, 2, 2);
  Enter(order, 3, 3);
  Enter(order, 1, 4);  // Held: nothing is lost.
  EXPECT_EQ(order.size(), 3u);
  EXPECT_FALSE(order.Lost(ChangeNumber::After(0)));
  Enter(order, 4, 5);  // 2 goes, which changed at revision 2.
  EXPECT_EQ(order.size(), 3u);
  EXPECT_TRUE(order.Lost(ChangeNumber::After(1)));
  EXPECT_FALSE(order.Lost(ChangeNumber::After(2)));
  EXPECT_EQ(After(order, ChangeNumber::After(2)), "3d1b4e");
}

TEST(GeoBox, HoldsItsPolygonAndWhatIsNear) {
  std::mt19937_64 random(11);
  std::uniform_real_distribution<double> unit(0, 1);
  for (int trial = 0; trial < 3000; ++trial) {
    const map::GeodeticPoint a = {-88 + 176 * unit(random),
                                  -180 + 360 * unit(random)};
    const double length_m = 300'000 * unit(random) * unit(random);
    const double azimuth_deg = 360 * unit(random);
    const map::GeodeticPoint b = map::Direct(a, azimuth_deg, length_m);
    const double margin_m = 1000 * unit(random);
    const GeoBox box = BoxAround(std::array{a, b}, margin_m);
    // A place on the geodesic between them, and beside it.
    const map::GeodeticPoint on =
        map::Direct(a, azimuth_deg, length_m * unit(random));
    const map::GeodeticPoint near =
        map::Direct(on, 360 * unit(random), margin_m * unit(random));
    EXPECT_TRUE(Touch(box, BoxAround(std::array{near}, 0)))
        << a.latitude_deg << " " << a.longitude_deg << " " << length_m << " "
        << azimuth_deg;
  }
}

TEST(GeoBox, TouchesAcrossTheAntimeridianAndNotBeyondItsSides) {
  const GeoBox date_line = {
      .south_deg = 10, .north_deg = 11, .west_deg = 179.5, .width_deg = 1};
  const auto point = [](double latitude_deg, double longitude_deg) {
    return GeoBox{.south_deg = latitude_deg,
                  .north_deg = latitude_deg,
                  .west_deg = longitude_deg,
                  .width_deg = 0};
  };
  EXPECT_TRUE(Touch(date_line, point(10.5, -179.6)));
  EXPECT_TRUE(Touch(point(10.5, -179.6), date_line));
  EXPECT_TRUE(Touch(date_line, point(10.5, 179.6)));
  EXPECT_FALSE(Touch(date_line, point(10.5, -179.4)));
  EXPECT_FALSE(Touch(date_line, point(10.5, 179.4)));
  EXPECT_FALSE(Touch(date_line, point(11.1, 180)));
  EXPECT_TRUE(Touch(GeoBox{}, date_line));
}

}  // namespace
}  // namespace fathom::server
