#include "sim_feeder/replay/ais.h"

#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <set>
#include <string>
#include <vector>

#include "sim_feeder/replay/vessel_report.h"
#include "tests/testing/status_matchers.h"

namespace fathom::feeder {
namespace {

const std::filesystem::path kAivdm =
    std::filesystem::path(FATHOM_SHARED_DATA_DIR) / "contacts/gpsd-aivdm";

// Every message of a log; sentences that are none are passed over.
std::vector<AisMessage> DecodeLog(const std::filesystem::path& path) {
  std::vector<AisMessage> messages;
  AisAssembler assembler;
  std::ifstream file(path);
  for (std::string line; std::getline(file, line);) {
    const absl::StatusOr<NmeaSentence> sentence = ParseNmea(line);
    if (!sentence.ok()) continue;
    const auto message = assembler.Take(*sentence);
    if (message.ok() && message->has_value()) messages.push_back(**message);
  }
  return messages;
}

// gpsd's decodings, one a line; other lines repeat the sentences.
std::vector<nlohmann::json> GoldensOf(const std::filesystem::path& path) {
  std::vector<nlohmann::json> goldens;
  std::ifstream file(path);
  for (std::string line; std::getline(file, line);) {
    if (line.starts_with('{')) goldens.push_back(nlohmann::json::parse(line));
  }
  return goldens;
}

// Messages and goldens of some types, in the order of the log.
struct Compared {
  std::vector<AisMessage> messages;
  std::vector<nlohmann::json> goldens;
};

Compared ReadBoth(const std::string& log, const std::string& golden,
                  const std::set<int>& types) {
  Compared both = {.messages = DecodeLog(kAivdm / log),
                   .goldens = GoldensOf(kAivdm / golden)};
  std::erase_if(both.messages, [&](const AisMessage& message) {
    return !types.contains(message.type);
  });
  std::erase_if(both.goldens, [&](const nlohmann::json& one) {
    return !types.contains(one.at("type"));
  });
  return both;
}

// gpsd's unscaled numbers: positions in 1/10 000 minute (type 27: 1/10), speed
// and course in tenths (27: whole). Says how many had a position.
int ComparePositions(const Compared& both) {
  int placed = 0;
  EXPECT_EQ(both.messages.size(), both.goldens.size());
  if (both.messages.size() != both.goldens.size()) return 0;
  for (std::size_t n = 0; n < both.messages.size(); ++n) {
    const AisMessage& message = both.messages[n];
    const nlohmann::json& golden = both.goldens[n];
    SCOPED_TRACE(golden.dump());
    EXPECT_EQ(message.type, golden.at("type"));
    EXPECT_EQ(message.mmsi, golden.at("mmsi"));
    const bool coarse = message.type == 27;
    const int per_degree = coarse ? 600 : 600'000;
    const bool known = golden.at("lat") <= 90 * per_degree &&
                       golden.at("lon") <= 180 * per_degree;
    EXPECT_EQ(message.position.has_value(), known);
    if (!message.position.has_value()) continue;
    ++placed;
    const AisPosition& position = *message.position;
    EXPECT_EQ(position.coarse, coarse);
    EXPECT_EQ(std::llround(position.place.latitude_deg * per_degree),
              golden.at("lat"));
    EXPECT_EQ(std::llround(position.place.longitude_deg * per_degree),
              golden.at("lon"));
    EXPECT_EQ(position.accurate, golden.at("accuracy"));
    // What is not available reads as gpsd prints it.
    const double per_unit = coarse ? 1 : 10;
    const double no_speed = coarse ? 63 : 102.3;
    EXPECT_EQ(std::llround(position.speed_kn.value_or(no_speed) * per_unit),
              golden.at("speed"));
    if (golden.at("course") < (coarse ? 360 : 3600)) {
      EXPECT_EQ(std::llround(position.course_deg.value_or(-1) * per_unit),
                golden.at("course"));
    } else {
      EXPECT_FALSE(position.course_deg.has_value());
    }
    if (!coarse && golden.at("second") < 60) {
      EXPECT_EQ(position.utc_second.value_or(-1), golden.at("second"));
    } else {
      EXPECT_FALSE(position.utc_second.has_value());
    }
  }
  return placed;
}

TEST(Ais, PositionsAreThoseOfGpsdsGoldens) {
  if (!std::filesystem::exists(kAivdm)) GTEST_SKIP() << "no " << kAivdm;
  const std::set<int> types = {1, 2, 3, 18, 19, 27};
  EXPECT_EQ(
      ComparePositions(ReadBoth("sample.aivdm", "sample.aivdm.ju.chk", types)),
      12);
  EXPECT_EQ(ComparePositions(ReadBoth("ais-nmea-type6-fid55.log",
                                      "ais-nmea-type6-fid55.log.chk", types)),
            797);
}

void CompareShips(const Compared& both) {
  ASSERT_EQ(both.messages.size(), both.goldens.size());
  for (std::size_t n = 0; n < both.messages.size(); ++n) {
    const AisMessage& message = both.messages[n];
    const nlohmann::json& golden = both.goldens[n];
    SCOPED_TRACE(golden.dump());
    EXPECT_EQ(message.mmsi, golden.at("mmsi"));
    ASSERT_TRUE(message.ship.has_value());
    EXPECT_EQ(message.ship->ship_type, golden.at("shiptype"));
    EXPECT_EQ(message.ship->length_m, golden.at("to_bow").get<int>() +
                                          golden.at("to_stern").get<int>());
    EXPECT_EQ(message.ship->beam_m, golden.at("to_port").get<int>() +
                                        golden.at("to_starboard").get<int>());
    EXPECT_EQ(std::llround(10 * message.ship->draught_m.value_or(0)),
              golden.value("draught", 0));
  }
}

TEST(Ais, ShipsAreThoseOfGpsdsGoldens) {
  if (!std::filesystem::exists(kAivdm)) GTEST_SKIP() << "no " << kAivdm;
  CompareShips(ReadBoth("sample.aivdm", "sample.aivdm.ju.chk", {5, 19}));
  CompareShips(ReadBoth("ais-nmea-type6-fid55.log",
                        "ais-nmea-type6-fid55.log.chk", {5}));
}

TEST(DecodeAis, RefusesWhatIsNone) {
  EXPECT_EQ(DecodeAis("", 0).status().message(), "bad payload");
  EXPECT_EQ(DecodeAis("1\x7f", 0).status().message(), "bad payload");
  EXPECT_EQ(DecodeAis("1", 6).status().message(), "bad payload");
  EXPECT_EQ(DecodeAis(std::string(183, '0'), 0).status().message(),
            "bad payload");
  // Type 1 in 168 bits is 28 characters; half of it is too short.
  FATHOM_EXPECT_OK(DecodeAis("13F?Vv700<DJuLEtvep`iToV0<00", 0));
  EXPECT_EQ(DecodeAis("13F?Vv700<DJuL", 0).status().message(),
            "message too short");
}

std::string Part(const std::string& fields) {
  int sum = 0;
  for (const char c : fields) sum ^= static_cast<unsigned char>(c);
  constexpr std::string_view kHex = "0123456789ABCDEF";
  const auto n = static_cast<std::size_t>(sum);
  return "!" + fields + "*" + kHex[n / 16] + kHex[n % 16];
}

absl::StatusOr<std::optional<AisMessage>> Take(AisAssembler& assembler,
                                               const std::string& fields) {
  const std::string line = Part(fields);
  const absl::StatusOr<NmeaSentence> sentence = ParseNmea(line);
  if (!sentence.ok()) return sentence.status();
  return assembler.Take(*sentence);
}

// The two parts of libais's tag block example: a type 5.
constexpr char kFirst[] =
    "53@o0E000001Q0CG37U8u<Tp4q@D00000000000018330400000000000000";
constexpr char kSecond[] = "00000000008";

TEST(AisAssembler, PutsMixedPartsTogether) {
  AisAssembler assembler;
  const std::string first = kFirst;
  ASSERT_FALSE(Take(assembler, "AIVDM,2,1,6,A," + first + ",0")->has_value());
  ASSERT_FALSE(Take(assembler, "AIVDM,2,1,6,B," + first + ",0")->has_value());
  EXPECT_EQ(assembler.pending(), 2U);
  const auto message =
      Take(assembler, "AIVDM,2,2,6,A," + std::string(kSecond) + ",2");
  FATHOM_ASSERT_OK(message);
  ASSERT_TRUE(message->has_value());
  EXPECT_EQ((*message)->type, 5);
  EXPECT_EQ(assembler.pending(), 1U);
}

TEST(AisAssembler, RefusesPartsThatFitNothing) {
  AisAssembler assembler;
  const auto refused = [&](const std::string& fields) {
    return Take(assembler, fields).status().message() == "bad fragment";
  };
  EXPECT_TRUE(refused("AIVDM,2,2,6,A,0000,2"));
  EXPECT_TRUE(refused("AIVDM,0,1,6,A,0000,2"));
  EXPECT_TRUE(refused("AIVDM,2,3,6,A,0000,2"));
  EXPECT_TRUE(refused("AIVDM,x,1,6,A,0000,2"));
  EXPECT_TRUE(refused("AIVDM"));
  // The third without the second ends the message.
  FATHOM_ASSERT_OK(Take(assembler, "AIVDM,3,1,7,A,0000,0"));
  EXPECT_TRUE(refused("AIVDM,3,3,7,A,0000,0"));
  EXPECT_EQ(assembler.pending(), 0U);
}

TEST(AisAssembler, HoldsABoundedNumber) {
  AisAssembler assembler;
  for (int n = 0; n < 100; ++n) {
    FATHOM_ASSERT_OK(
        Take(assembler, "AIVDM,2,1," + std::to_string(n) + ",A,0000,0"));
    EXPECT_LE(assembler.pending(), AisAssembler::kMaxPending);
  }
}

TEST(ClassOf, FollowsTypeDraughtAndLength) {
  EXPECT_EQ(ClassOf({}), v1::CONTACT_CLASS_UNKNOWN);
  const auto of = [](int type, int length_m, double draught_m) {
    AisShip ship = {.ship_type = type, .length_m = length_m};
    if (draught_m > 0) ship.draught_m = draught_m;
    return ClassOf(ship);
  };
  EXPECT_EQ(of(80, 20, 3), v1::CONTACT_CLASS_DEEP_DRAUGHT);
  EXPECT_EQ(of(70, 295, 12.2), v1::CONTACT_CLASS_DEEP_DRAUGHT);
  EXPECT_EQ(of(70, 90, 5), v1::CONTACT_CLASS_VESSEL);
  EXPECT_EQ(of(30, 24, 0), v1::CONTACT_CLASS_SMALL_CRAFT);
  EXPECT_EQ(of(36, 0, 0), v1::CONTACT_CLASS_SMALL_CRAFT);
  EXPECT_EQ(of(60, 0, 0), v1::CONTACT_CLASS_VESSEL);
  EXPECT_EQ(of(0, 0, 0), v1::CONTACT_CLASS_UNKNOWN);
}

TEST(FixOf, TellsVelocityAndItsUncertainty) {
  const Time time(std::chrono::seconds(1'418'172'113));
  AisPosition position = {.place = {.latitude_deg = 50, .longitude_deg = -1},
                          .speed_kn = 10,
                          .course_deg = 90,
                          .accurate = true};
  // 10 knots are 5.1444 m/s, due east.
  v1::ContactReport report = FixOf(235'070'762, position, {}, time);
  EXPECT_EQ(report.contact_id(), "mmsi:235070762");
  EXPECT_NEAR(report.fix().velocity_north_m_s(), 0, 1e-9);
  EXPECT_NEAR(report.fix().velocity_east_m_s(), 5.14444, 1e-5);
  EXPECT_EQ(report.fix().position_std_m(), 5);
  EXPECT_EQ(report.fix().velocity_std_m_s(), 0.5);
  // Without course nothing is known but that it moves.
  position.course_deg.reset();
  position.accurate = false;
  report = FixOf(1, position, {}, time);
  EXPECT_EQ(report.contact_id(), "mmsi:000000001");
  EXPECT_EQ(report.fix().velocity_east_m_s(), 0);
  EXPECT_EQ(report.fix().velocity_std_m_s(), 5);
  EXPECT_EQ(report.fix().position_std_m(), 10);
  // At rest a course is not needed.
  position.speed_kn = 0;
  EXPECT_EQ(FixOf(1, position, {}, time).fix().velocity_std_m_s(), 0.5);
  // Rounding to 185.2 m: uniform, 185.2 / sqrt(12) = 53.46; with 10: 54.39.
  position.coarse = true;
  EXPECT_NEAR(FixOf(1, position, {}, time).fix().position_std_m(), 54.39, 0.01);
}

TEST(TimeOfFix, IsTheSecondToldNextToTheReception) {
  const auto at = [](int hour, int minute, int second) {
    return Time(std::chrono::hours(hour) + std::chrono::minutes(minute) +
                std::chrono::seconds(second));
  };
  EXPECT_EQ(TimeOfFix(at(1, 2, 33), 30), at(1, 2, 30));
  EXPECT_EQ(TimeOfFix(at(1, 2, 1), 58), at(1, 1, 58));
  EXPECT_EQ(TimeOfFix(at(1, 2, 59), 1), at(1, 3, 1));
  EXPECT_EQ(TimeOfFix(at(1, 2, 33), {}), at(1, 2, 33));
  // Eleven seconds off: the clocks do not agree.
  EXPECT_EQ(TimeOfFix(at(1, 2, 41), 30), at(1, 2, 41));
}

}  // namespace
}  // namespace fathom::feeder
