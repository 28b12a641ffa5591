#include "sim_feeder/replay/ais.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "absl/status/status.h"

namespace fathom::feeder {
namespace {

// The longest message: five slots, 1064 bits.
constexpr std::size_t kMaxPayload = 182;

// The bits of a payload, most significant first.
class Bits {
 public:
  // Errors: "bad payload".
  static absl::StatusOr<Bits> Unarmour(std::string_view payload,
                                       int fill_bits) {
    if (payload.size() > kMaxPayload || fill_bits < 0 || fill_bits > 5 ||
        payload.empty()) {
      return absl::InvalidArgumentError("bad payload");
    }
    Bits bits;
    bits.sixes_.reserve(payload.size());
    for (const char c : payload) {
      const bool low = c >= '0' && c <= 'W';
      if (!low && !(c >= '`' && c <= 'w')) {
        return absl::InvalidArgumentError("bad payload");
      }
      bits.sixes_.push_back(
          static_cast<std::uint8_t>(low ? c - '0' : c - '`' + 40));
    }
    bits.size_ = 6 * payload.size() - static_cast<std::size_t>(fill_bits);
    return bits;
  }

  std::size_t size() const { return size_; }

  // `count` bits from `begin`. REQUIRES: within size(), count <= 32.
  std::uint32_t Unsigned(std::size_t begin, std::size_t count) const {
    std::uint32_t value = 0;
    for (std::size_t n = begin; n < begin + count; ++n) {
      value = value << 1 | ((sixes_[n / 6] >> (5 - n % 6)) & 1u);
    }
    return value;
  }
  int Int(std::size_t begin, std::size_t count) const {
    return static_cast<int>(Unsigned(begin, count));
  }
  // Two's complement.
  int Signed(std::size_t begin, std::size_t count) const {
    const int value = Int(begin, count);
    return Unsigned(begin, 1) == 0 ? value : value - (1 << count);
  }
  bool Flag(std::size_t n) const { return Unsigned(n, 1) != 0; }

 private:
  std::vector<std::uint8_t> sixes_;
  std::size_t size_ = 0;
};

// Where the fields of a position are: only the first bit differs by type.
std::optional<AisPosition> ReadPosition(const Bits& bits,
                                        std::size_t speed_at) {
  const std::size_t at = speed_at;
  AisPosition position = {
      .place = {.latitude_deg = bits.Signed(at + 39, 27) / 600'000.0,
                .longitude_deg = bits.Signed(at + 11, 28) / 600'000.0},
      .accurate = bits.Flag(at + 10)};
  // 91 and 181 degrees stand for "not available".
  if (std::fabs(position.place.latitude_deg) > 90 ||
      std::fabs(position.place.longitude_deg) > 180) {
    return std::nullopt;
  }
  if (const int speed = bits.Int(at, 10); speed != 1023) {
    position.speed_kn = speed / 10.0;
  }
  if (const int course = bits.Int(at + 66, 12); course < 3600) {
    position.course_deg = course / 10.0;
  }
  if (const int second = bits.Int(at + 87, 6); second < 60) {
    position.utc_second = second;
  }
  return position;
}

// Type 27, of satellites: coarse.
std::optional<AisPosition> ReadLongRange(const Bits& bits) {
  AisPosition position = {
      .place = {.latitude_deg = bits.Signed(62, 17) / 600.0,
                .longitude_deg = bits.Signed(44, 18) / 600.0},
      .accurate = bits.Flag(38),
      .coarse = true};
  if (std::fabs(position.place.latitude_deg) > 90 ||
      std::fabs(position.place.longitude_deg) > 180) {
    return std::nullopt;
  }
  if (const int speed = bits.Int(79, 6); speed != 63) {
    position.speed_kn = speed;
  }
  if (const int course = bits.Int(85, 9); course < 360) {
    position.course_deg = course;
  }
  return position;
}

// Type and four distances from the antenna to bow, stern, port and starboard.
AisShip ReadShip(const Bits& bits, std::size_t type_at,
                 std::size_t dimensions_at) {
  const std::size_t at = dimensions_at;
  return {.ship_type = bits.Int(type_at, 8),
          .length_m = bits.Int(at, 9) + bits.Int(at + 9, 9),
          .beam_m = bits.Int(at + 18, 6) + bits.Int(at + 24, 6)};
}

}  // namespace

absl::StatusOr<AisMessage> DecodeAis(std::string_view payload, int fill_bits) {
  const absl::StatusOr<Bits> read = Bits::Unarmour(payload, fill_bits);
  if (!read.ok()) return read.status();
  const Bits& bits = *read;
  const auto too_short = [&](std::size_t least) { return bits.size() < least; };
  const absl::Status short_error =
      absl::InvalidArgumentError("message too short");
  if (too_short(38)) return short_error;
  AisMessage message = {.type = bits.Int(0, 6), .mmsi = bits.Unsigned(8, 30)};
  if (message.type < 1 || message.type > 27) {
    return absl::InvalidArgumentError("bad payload");
  }
  switch (message.type) {
    case 1:
    case 2:
    case 3:
      if (too_short(143)) return short_error;
      message.position = ReadPosition(bits, 50);
      break;
    case 5: {
      // 424 bits as published, 420 and 422 as some send; all hold the draught.
      if (too_short(302)) return short_error;
      AisShip ship = ReadShip(bits, 232, 240);
      if (const int draught = bits.Int(294, 8); draught != 0) {
        ship.draught_m = draught / 10.0;
      }
      message.ship = ship;
      break;
    }
    case 18:
      if (too_short(139)) return short_error;
      message.position = ReadPosition(bits, 46);
      break;
    case 19:
      if (too_short(301)) return short_error;
      message.position = ReadPosition(bits, 46);
      message.ship = ReadShip(bits, 263, 271);
      break;
    case 24:
      if (too_short(40)) return short_error;
      if (bits.Int(38, 2) != 1) break;  // Part A: the name.
      if (too_short(162)) return short_error;
      message.ship = ReadShip(bits, 40, 132);
      // An auxiliary craft tells its mother ship in place of its dimensions.
      if (message.mmsi / 10'000'000 == 98) {
        message.ship->length_m = 0;
        message.ship->beam_m = 0;
      }
      break;
    case 27:
      if (too_short(95)) return short_error;
      message.position = ReadLongRange(bits);
      break;
    default:
      break;
  }
  return message;
}

absl::StatusOr<std::optional<AisMessage>> AisAssembler::Take(
    const NmeaSentence& sentence) {
  const auto digit = [&](std::size_t n) {
    const std::string_view field = sentence.field(n);
    return field.size() == 1 && field[0] >= '0' && field[0] <= '9'
               ? field[0] - '0'
               : -1;
  };
  const absl::Status bad_fragment = absl::InvalidArgumentError("bad fragment");
  const int count = digit(0);
  const int number = digit(1);
  const int fill_bits = digit(5);
  if (count < 1 || number < 1 || number > count || fill_bits < 0) {
    return bad_fragment;
  }
  const std::string_view payload = sentence.field(4);
  const auto decode =
      [](std::string_view text,
         int fill) -> absl::StatusOr<std::optional<AisMessage>> {
    absl::StatusOr<AisMessage> message = DecodeAis(text, fill);
    if (!message.ok()) return message.status();
    return *std::move(message);
  };
  if (count == 1) return decode(payload, fill_bits);

  std::string id(sentence.field(2));
  id.append("/").append(sentence.field(3));
  auto begun = std::find_if(pending_.begin(), pending_.end(),
                            [&](const Pending& p) { return p.id == id; });
  if (number == 1) {
    if (begun != pending_.end()) pending_.erase(begun);
    if (pending_.size() == kMaxPending) pending_.pop_front();
    pending_.push_back(
        {.id = std::move(id), .count = count, .parts = {std::string(payload)}});
    return std::optional<AisMessage>();
  }
  if (begun == pending_.end() || begun->count != count ||
      begun->parts.size() + 1 != static_cast<std::size_t>(number)) {
    if (begun != pending_.end()) pending_.erase(begun);
    return bad_fragment;
  }
  begun->parts.emplace_back(payload);
  if (number < count) return std::optional<AisMessage>();
  std::string whole;
  for (const std::string& part : begun->parts) whole += part;
  pending_.erase(begun);
  return decode(whole, fill_bits);
}

}  // namespace fathom::feeder
