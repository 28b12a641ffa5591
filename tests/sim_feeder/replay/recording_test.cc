#include "sim_feeder/replay/recording.h"

#include <gtest/gtest.h>

#include <chrono>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "client/proto_time.h"
#include "map/geodesy/ned_frame.h"
#include "sim_feeder/angles.h"
#include "sim_feeder/replay/sounding_pings.h"
#include "tests/testing/status_matchers.h"

namespace fathom::feeder {
namespace {

Time At(const std::string& text) { return ParseTime(text).value_or(Time()); }

// With the checksum that it lacks.
std::string Sentence(const std::string& body) {
  int sum = 0;
  for (const char c : body) sum ^= static_cast<unsigned char>(c);
  constexpr std::string_view kHex = "0123456789ABCDEF";
  const auto n = static_cast<std::size_t>(sum);
  return "$" + body + "*" + kHex[n / 16] + kHex[n % 16] + "\n";
}

class RecordingTest : public ::testing::Test {
 protected:
  RecordingTest() {
    std::string name =
        (std::filesystem::path(::testing::TempDir()) / "replay.XXXXXX")
            .string();
    folder_ = mkdtemp(name.data());
  }
  ~RecordingTest() override { std::filesystem::remove_all(folder_); }

  std::string Write(const std::string& name, const std::string& text) {
    const std::string path = (folder_ / name).string();
    std::ofstream(path, std::ios::binary) << text;
    return path;
  }

  // All events; what was passed over goes to passed_over_.
  std::vector<RecordedEvent> Read(const std::string& path,
                                  const RecordingOptions& options = {}) {
    std::vector<RecordedEvent> events;
    const auto recording = OpenRecording(path, options);
    FATHOM_EXPECT_OK(recording);
    if (!recording.ok()) return events;
    for (;;) {
      auto event = (*recording)->Next();
      FATHOM_EXPECT_OK(event);
      if (!event.ok() || !event->has_value()) break;
      events.push_back(std::move(**event));
    }
    passed_over_ = (*recording)->passed_over();
    return events;
  }

  std::filesystem::path folder_;
  std::map<std::string, std::uint64_t> passed_over_;
};

TEST_F(RecordingTest, ALogsDepthsAreTakenWhereTheVesselWas) {
  const std::string path = Write(
      "day.nmea",
      // Before a fix, before a date: nothing can be said.
      Sentence("IIDBT,034.25,f,010.44,M,005.64,F") +
          Sentence("GPRMC,235958,A,4807.038,N,01131.000,E,5,84,230394,,") +
          Sentence("IIDBT,034.25,f,010.44,M,005.64,F") +
          // Two seconds later, on the next day; depth below the transducer
          // which is 0.5 m below the surface.
          Sentence("GPGLL,4807.040,N,01131.000,E,000000,A") +
          Sentence("SDDPT,12.5,0.5") + Sentence("SDDPT,12.5,-0.3") +
          // Not available, and sentences that are not ours.
          Sentence("SDDPT,,") + Sentence("IIMWV,338,R,13.41,N,A") +
          "$GPRMC,broken*00\n# a note\n\n");
  const std::vector<RecordedEvent> events =
      Read(path, {.depth_std_m = 0.2, .transducer_depth_m = 2});
  ASSERT_EQ(events.size(), 3U);
  const Sounding& first = std::get<Sounding>(events[0].what);
  EXPECT_EQ(events[0].time, At("1994-03-23T23:59:58Z"));
  EXPECT_DOUBLE_EQ(first.depth_m, 10.44 + 2);
  EXPECT_DOUBLE_EQ(first.std_m, 0.2);
  EXPECT_NEAR(first.place.latitude_deg, 48 + 7.038 / 60, 1e-9);
  EXPECT_EQ(events[1].time, At("1994-03-24T00:00:00Z"));
  // A positive offset is the waterline's; a negative one the keel's.
  EXPECT_DOUBLE_EQ(std::get<Sounding>(events[1].what).depth_m, 13.0);
  EXPECT_DOUBLE_EQ(std::get<Sounding>(events[2].what).depth_m, 14.5);
  EXPECT_EQ(passed_over_,
            (std::map<std::string, std::uint64_t>{{"no time", 1},
                                                  {"no depth", 1},
                                                  {"other sentence", 1},
                                                  {"bad checksum", 1}}));
}

TEST_F(RecordingTest, AnOldFixIsNoPlaceForADepth) {
  const std::string path = Write(
      "day.nmea",
      Sentence("GPRMC,120000,A,4807.038,N,01131.000,E,5,84,230394,,") +
          Sentence("GPZDA,120005,23,03,1994,,") + Sentence("SDDPT,12.5,") +
          Sentence("GPZDA,120006,23,03,1994,,") + Sentence("SDDPT,12.5,") +
          Sentence("GPRMC,120007,V,,,,,,,230394,,"));
  EXPECT_EQ(Read(path).size(), 1U);
  EXPECT_EQ(passed_over_.at("no position"), 1U);
  EXPECT_EQ(passed_over_.at("no fix"), 1U);
}

TEST_F(RecordingTest, TableColumnsAreKnownByTheirNames) {
  const std::string path =
      Write("survey.csv",
            "id,Longitude,Latitude,Depth_m,TVU,UTC\n"
            "1,-71.3,41.5,12.25,0.98,2024-05-01T10:00:00Z\n"
            "2,-71.3,41.5,42949672.92,0.98,2024-05-01T10:00:01Z\n"
            "3,-71.3,95,12,0.98,2024-05-01 10:00:02.5\n"
            "4,-71.3,41.5,,0.98,2024-05-01 10:00:02.5\n"
            "5,-71.3,41.5,12,0,2024-05-01 10:00:02.5\n"
            "6,-71.3,41.5,12,0.98,noon\n");
  const std::vector<RecordedEvent> events =
      Read(path, {.uncertainty_95 = true});
  ASSERT_EQ(events.size(), 2U);
  const Sounding& first = std::get<Sounding>(events[0].what);
  EXPECT_EQ(events[0].time, At("2024-05-01T10:00:00Z"));
  EXPECT_DOUBLE_EQ(first.depth_m, 12.25);
  EXPECT_DOUBLE_EQ(first.std_m, 0.5);  // 0.98 / 1.96.
  EXPECT_DOUBLE_EQ(first.place.longitude_deg, -71.3);
  // Without one of its own: sqrt(0.5^2 + (0.013 * 12)^2) / 1.96 = 0.26723.
  EXPECT_EQ(events[1].time, At("2024-05-01T10:00:02.500Z"));
  EXPECT_NEAR(std::get<Sounding>(events[1].what).std_m, 0.26723, 1e-5);
  EXPECT_EQ(passed_over_,
            (std::map<std::string, std::uint64_t>{{"depth out of range", 1},
                                                  {"no position", 1},
                                                  {"no depth", 1},
                                                  {"no time", 1}}));
}

TEST_F(RecordingTest, XyzTextWithoutHeaderOrTime) {
  const std::string path =
      Write("survey.xyz", "-71.3 41.5 -12.25\n-71.3 41.6 -13\n");
  const std::vector<RecordedEvent> events =
      Read(path, {.start_time = At("2024-05-01T10:00:00Z"),
                  .line_interval_s = 0.5,
                  .positive_up = true});
  ASSERT_EQ(events.size(), 2U);
  EXPECT_EQ(events[1].time, At("2024-05-01T10:00:00.500Z"));
  EXPECT_DOUBLE_EQ(std::get<Sounding>(events[0].what).depth_m, 12.25);
  EXPECT_DOUBLE_EQ(std::get<Sounding>(events[1].what).place.latitude_deg, 41.6);
}

TEST_F(RecordingTest, BeamsOfOnePingStandTogether) {
  const std::string path =
      Write("fan.csv",
            "utc,ping,lat,lon,heading_deg,across_m,depth_below_sonar_m\n"
            "2024-05-01T10:00:00,7,41.5,-71.3,90,-20,10\n"
            "2024-05-01T10:00:00,7,41.5,-71.3,90,0,10\n"
            "2024-05-01T10:00:00,7,41.5,-71.3,90,15,11\n"
            "2024-05-01T10:00:01,8,41.5,-71.3,90,15,11\n");
  const std::vector<RecordedEvent> events =
      Read(path, {.transducer_depth_m = 1});
  ASSERT_EQ(events.size(), 2U);
  const v1::Ping& ping = std::get<v1::Ping>(events[0].what);
  ASSERT_EQ(ping.range_m_size(), 2);
  EXPECT_EQ(ping.range_m(0), 20);
  EXPECT_EQ(ping.bearing_deg(0), -90);  // Port.
  EXPECT_EQ(ping.bearing_deg(1), 90);
  EXPECT_EQ(ping.depth_m(1), 12);
  EXPECT_EQ(ping.pose().heading_deg(), 90);
  EXPECT_EQ(passed_over_.at("no beam"), 1U);
}

TEST_F(RecordingTest, VesselsOfATableAreContacts) {
  const std::string path =
      Write("ais.csv",
            "Time,MMSI,Latitude,Longitude,COG,SOG\n"
            "2016-01-12 13:02:11,235070762,50.7,-1.0,0,10\n"
            "2016-01-12 13:02:12,x,50.7,-1.0,0,10\n");
  const std::vector<RecordedEvent> events = Read(path);
  ASSERT_EQ(events.size(), 1U);
  const auto& report = std::get<v1::ContactReport>(events[0].what);
  EXPECT_EQ(report.contact_id(), "mmsi:235070762");
  EXPECT_NEAR(report.fix().velocity_north_m_s(), 5.14444, 1e-5);
  EXPECT_EQ(client::FromProto(report.time()), At("2016-01-12T13:02:11Z"));
  EXPECT_EQ(passed_over_.at("no mmsi"), 1U);
}

TEST_F(RecordingTest, ErrorsSayWhatIsMissing) {
  const auto message = [&](const std::string& path) {
    const auto recording = OpenRecording(path, {});
    return recording.ok() ? "" : std::string(recording.status().message());
  };
  EXPECT_EQ(message("/no/such/file"), "no file /no/such/file");
  EXPECT_NE(message(Write("a.csv", "lat,lon,colour\n1,2,red\n"))
                .find("no column for depth or mmsi"),
            std::string::npos);
  EXPECT_NE(message(Write("b.csv", "depth,colour\n1,red\n"))
                .find("no column for the place"),
            std::string::npos);
  EXPECT_NE(message(Write("c.bin", std::string(5000, '\0')))
                .find("is no table of points"),
            std::string::npos);
  EXPECT_NE(
      message(Write("d.json", "[{\"sensorID\": 2}]")).find("_detections.json"),
      std::string::npos);
}

TEST(SoundingPings, PlacesAreExactAndNoRangeIsNought) {
  const Time time = At("2024-05-01T10:00:00Z");
  const map::NedFrame frame({.latitude_deg = 41.5, .longitude_deg = -71.3});
  SoundingPings pings;
  std::vector<Sounding> soundings;
  for (int n = 0; n < 20; ++n) {
    soundings.push_back({.place = frame.ToGeodetic(-3.0 * n, 4.0 * (n % 5)),
                         .depth_m = 10.0 + n,
                         .std_m = 0.1});
    EXPECT_FALSE(pings.Add(time, soundings.back()).has_value());
  }
  const std::optional<RecordedEvent> event = pings.Finish();
  ASSERT_TRUE(event.has_value());
  const v1::Ping& ping = std::get<v1::Ping>(event->what);
  ASSERT_EQ(ping.range_m_size(), 20);
  const map::NedFrame from(
      {.latitude_deg = ping.pose().position().latitude_deg(),
       .longitude_deg = ping.pose().position().longitude_deg()});
  for (int n = 0; n < 20; ++n) {
    // Eqs. 4.1 and 4.2 back to the place.
    const double azimuth_rad = ping.bearing_deg(n) * kRadiansPerDegree;
    const map::NedPoint there =
        from.ToNed(soundings[static_cast<std::size_t>(n)].place);
    EXPECT_GE(ping.range_m(n), 0.999f);
    EXPECT_NEAR(ping.range_m(n) * std::cos(azimuth_rad), there.north_m, 1e-3);
    EXPECT_NEAR(ping.range_m(n) * std::sin(azimuth_rad), there.east_m, 1e-3);
    EXPECT_EQ(ping.depth_m(n), static_cast<float>(10 + n));
  }
  EXPECT_FALSE(pings.Finish().has_value());
}

TEST(SoundingPings, APingEndsWithItsPlaceItsSecondAndItsRoom) {
  const Time time = At("2024-05-01T10:00:00Z");
  const Sounding here = {
      .place = {.latitude_deg = 41.5, .longitude_deg = -71.3},
      .depth_m = 10,
      .std_m = 0.1};
  Sounding far = here;
  far.place.latitude_deg += 0.001;  // 111 m.
  SoundingPings pings;
  EXPECT_FALSE(pings.Add(time, here).has_value());
  EXPECT_TRUE(pings.Add(time, far).has_value());
  EXPECT_TRUE(
      pings.Add(time + std::chrono::milliseconds(1001), far).has_value());
  ASSERT_TRUE(pings.Finish().has_value());
  for (std::size_t n = 0; n < SoundingPings::kMaxSoundings; ++n) {
    EXPECT_FALSE(pings.Add(time, here).has_value());
  }
  const std::optional<RecordedEvent> full = pings.Add(time, here);
  ASSERT_TRUE(full.has_value());
  EXPECT_EQ(std::get<v1::Ping>(full->what).range_m_size(),
            static_cast<int>(SoundingPings::kMaxSoundings));
}

}  // namespace
}  // namespace fathom::feeder
