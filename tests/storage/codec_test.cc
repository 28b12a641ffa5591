// Every codec gives back what it was given, bit for bit, and takes damage as
// an error.

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <functional>
#include <memory>
#include <random>

#include "storage/activity_codec.h"
#include "storage/blob.h"
#include "storage/contact_codec.h"
#include "storage/journal_codec.h"
#include "storage/tile_codec.h"
#include "tests/storage/sample_records.h"
#include "tests/testing/status_matchers.h"

namespace fathom::storage {
namespace {

using ::fathom::testing::IsOk;
using ::fathom::testing::StatusIs;
using ::testing::HasSubstr;

// Decodes damaged payloads with a right checksum: what a CRC collision or a
// hostile writer would bring. Nothing may crash; the result is not looked at.
void ExpectNoCrash(const Bytes& blob, BlobKind kind,
                   const std::function<void(ByteSpan)>& decode) {
  std::mt19937 random(7);
  const Bytes payload(blob.begin() + kBlobHeaderBytes, blob.end());
  for (int trial = 0; trial < 3000; ++trial) {
    Bytes damaged = payload;
    const int flips = 1 + static_cast<int>(random() % 3);
    for (int i = 0; i < flips; ++i) {
      damaged[random() % damaged.size()] = static_cast<std::uint8_t>(random());
    }
    if (trial % 4 == 0) damaged.resize(random() % damaged.size());
    ByteWriter writer = StartBlob();
    writer.PutBytes(damaged);
    decode(SealBlob(kind, blob[1], std::move(writer)));
  }
}

map::TileContent SampleTile(std::size_t leaves, bool residuals) {
  std::mt19937 random(static_cast<unsigned>(leaves));
  map::TileContent content;
  for (std::size_t i = 0; i < leaves; ++i) {
    content.levels.push_back(static_cast<std::uint8_t>(6 - i % 2));
    content.depths_m.push_back(20.0f +
                               static_cast<float>(random() % 1000) / 300.0f);
    content.std_codes.push_back(
        static_cast<std::uint16_t>(0x8000 | (5000 + random() % 300)));
    content.times_s.push_back(
        static_cast<std::uint32_t>(1'000'000'000u + random() % 600));
    if (residuals) {
      content.residual_codes.push_back(static_cast<std::uint8_t>(random()));
      content.spread_codes.push_back(static_cast<std::uint8_t>(random()));
      if (i % 100 == 7) {
        content.hazard_slots.push_back(static_cast<std::uint16_t>(i));
        content.hazards_m.push_back(static_cast<float>(random() % 100));
      }
    }
  }
  return content;
}

TEST(TileCodec, ContentComesBackEqual) {
  const map::TileKey key{.level = 12, .row = 4095, .col = 17};
  for (const std::size_t leaves : {1u, 4u, 700u, 4096u}) {
    for (const bool residuals : {false, true}) {
      const map::TileContent content = SampleTile(leaves, residuals);
      const Bytes blob = EncodeTile(key, content);
      FATHOM_ASSERT_OK_AND_ASSIGN(const map::TileContent back,
                                  DecodeTile(key, blob));
      EXPECT_EQ(back, content) << leaves;
    }
  }
}

TEST(TileCodec, FlippedBitIsAnErrorThatNamesTheTile) {
  const map::TileKey key{.level = 6, .row = 3, .col = 5};
  Bytes blob = EncodeTile(key, SampleTile(700, false));
  blob[blob.size() / 2] ^= 0x10;
  EXPECT_THAT(DecodeTile(key, blob),
              StatusIs(absl::StatusCode::kDataLoss,
                       HasSubstr("tile level=6 row=3 col=5")));
}

TEST(TileCodec, TileUnderAnotherKeyIsFoundOut) {
  const Bytes blob =
      EncodeTile({.level = 6, .row = 3, .col = 5}, SampleTile(4, false));
  EXPECT_THAT(DecodeTile({.level = 6, .row = 3, .col = 6}, blob),
              StatusIs(absl::StatusCode::kDataLoss, HasSubstr("another")));
}

TEST(TileCodec, DamageNeverCrashes) {
  const map::TileKey key{.level = 6, .row = 3, .col = 5};
  ExpectNoCrash(EncodeTile(key, SampleTile(200, true)), BlobKind::kTile,
                [&](ByteSpan blob) { DecodeTile(key, blob).IgnoreError(); });
}

void ExpectSameBlock(const map::LocalBlock& a, const map::LocalBlock& b) {
  EXPECT_EQ(a.evidence, b.evidence);
  EXPECT_EQ(a.uniform_prior, b.uniform_prior);
  ASSERT_EQ(a.prior_grid == nullptr, b.prior_grid == nullptr);
  if (a.prior_grid != nullptr) {
    EXPECT_EQ(*a.prior_grid, *b.prior_grid);
  }
  EXPECT_EQ(a.nervegna, b.nervegna);
  EXPECT_EQ(a.pending, b.pending);
}

map::LocalBlock SampleBlock(int touched) {
  std::mt19937 random(11);
  map::LocalBlock block;
  for (int i = 0; i < touched; ++i) {
    map::Evidence cell;
    cell.weight = 11.1f * static_cast<float>(i + 1);
    cell.mean_m = 20.0f + static_cast<float>(i) / 7.0f;
    cell.scatter = 1.0f / static_cast<float>(i + 1);
    cell.shoalest_m = 19.0f;
    cell.time_s = 1'000'000'000u + static_cast<unsigned>(i);
    cell.count = static_cast<std::uint16_t>(i);
    block.evidence.Set(random() % map::kBlockCells, cell, i % 3 != 0);
  }
  block.uniform_prior = {
      .depth_m = 20.0f, .std_m = 5.0f, .kind = map::EvidenceKind::kPrior};
  return block;
}

TEST(BlockCodec, BlockComesBackBitForBit) {
  const BlockKey key{.activity_number = 3, .index = {.row = 7, .col = 4095}};
  for (const int touched : {0, 1, 40, 2000}) {
    map::LocalBlock block = SampleBlock(touched);
    FATHOM_ASSERT_OK_AND_ASSIGN(const map::LocalBlock back,
                                DecodeBlock(key, EncodeBlock(key, block)));
    ExpectSameBlock(block, back);
  }
}

TEST(BlockCodec, TransferredPriorsAndNervegnaComeBack) {
  const BlockKey key{.activity_number = 1, .index = {.row = 0, .col = 0}};
  map::LocalBlock block = SampleBlock(20);
  block.evidence.MarkTransferred();
  block.evidence.Add(3, 18.5f, 0.2f, 1'000'000'100u);
  auto grid = std::make_shared<map::PriorGrid>();
  grid->depth_m.fill(30.0f);
  grid->depth_m[5] = -0.0f;
  grid->std_m.fill(2.0f);
  grid->kind.fill(map::EvidenceKind::kLand);
  grid->hazard_m.assign(map::kBlockCells,
                        std::numeric_limits<float>::infinity());
  grid->hazard_m[9] = 3.5f;
  block.prior_grid = grid;
  block.nervegna.assign(
      map::kBlockCells,
      {.mean_m = 21.0f, .variance_m2 = std::numeric_limits<float>::infinity()});
  block.pending = {{.depth_m = 0.55f, .std_m = 0.1f, .time_s = 7, .cell = 3},
                   {.depth_m = 4.0f, .std_m = 0.2f, .cell = 255, .since = 9}};
  FATHOM_ASSERT_OK_AND_ASSIGN(const map::LocalBlock back,
                              DecodeBlock(key, EncodeBlock(key, block)));
  ExpectSameBlock(block, back);
  EXPECT_TRUE(std::signbit(back.prior_grid->depth_m[5]));
}

TEST(BlockCodec, UntouchedCellsTakeNoRoom) {
  // Header 8, key 8, flags 1, prior 13, window 4, mask 32: 66; one touched cell
  // adds its 20 planes of one element, two bytes each: 106.
  const BlockKey key{.activity_number = 1, .index = {}};
  EXPECT_EQ(EncodeBlock(key, SampleBlock(0)).size(), 66u);
  EXPECT_EQ(EncodeBlock(key, SampleBlock(1)).size(), 106u);
}

TEST(BlockCodec, DamageNeverCrashes) {
  const BlockKey key{.activity_number = 1, .index = {}};
  map::LocalBlock block = SampleBlock(100);
  block.nervegna.resize(map::kBlockCells);
  ExpectNoCrash(EncodeBlock(key, block), BlobKind::kLocalBlock,
                [&](ByteSpan blob) { DecodeBlock(key, blob).IgnoreError(); });
}

TEST(BlockKey, PacksAndUnpacks) {
  const BlockKey key{.activity_number = 10'000,
                     .index = {.row = 65'535, .col = 1}};
  const BlockKey back = BlockKey::FromPacked(key.Packed());
  EXPECT_EQ(back.activity_number, key.activity_number);
  EXPECT_EQ(back.index, key.index);
  // 10000 * 2^32 + 65535 * 2^16 + 1.
  EXPECT_EQ(key.Packed(), 10'000ull * 4294967296ull + 65'535ull * 65'536 + 1);
}

TEST(ContactCodec, PointHasTheStatedSize) {
  ByteWriter writer;
  PutContactPoint(SampleContactPoint(1), writer);
  EXPECT_EQ(writer.size(), kContactPointBytes);
}

TEST(ContactCodec, ContactComesBackBitForBit) {
  for (const int count : {1, 2, 256}) {
    map::StoredContact contact;
    contact.key = {.source = {"radar"}, .contact = {"c:7"}};
    for (int i = 0; i < count; ++i) {
      map::ContactEstimate estimate;
      static_cast<map::ContactPoint&>(estimate) = SampleContactPoint(i);
      estimate.key = contact.key;
      contact.estimates.push_back(estimate);
    }
    for (int i = 0; i < std::min(count, 64); ++i) {
      map::RecentReport recent{.report = SampleReport(i, ""),
                               .gated = i % 3 == 2,
                               .points = static_cast<std::uint8_t>(i % 3)};
      if (recent.gated) recent.points = 0;
      recent.report.key = {};
      contact.recent.push_back(recent);
    }
    FATHOM_ASSERT_OK_AND_ASSIGN(const map::StoredContact back,
                                DecodeContact(EncodeContact(contact), "c"));
    EXPECT_EQ(back.key, contact.key);
    EXPECT_EQ(back.estimates, contact.estimates);
    EXPECT_EQ(back.recent, contact.recent);
    EXPECT_TRUE(std::signbit(back.estimates[0].frame_origin.longitude_deg));
  }
}

TEST(ContactCodec, LinkedNamesComeBackAndTakeAVersionOfTheirOwn) {
  const std::vector<map::ContactKey> names = {
      {.source = {"ais"}, .contact = {"235000001"}},
      {.source = {"sonar"}, .contact = {"S:1"}}};
  map::StoredContact contact;
  contact.key = {.source = {"c4i"}, .contact = {"T9"}};
  contact.estimates.resize(1);
  static_cast<map::ContactPoint&>(contact.estimates[0]) = SampleContactPoint(3);
  contact.estimates[0].key = contact.key;
  contact.links =
      map::ContactLinks{.since = TimeFromUnixMicros(7), .names = names};
  const Bytes stored = EncodeContact(contact);
  EXPECT_EQ(stored[1], 3);
  FATHOM_ASSERT_OK_AND_ASSIGN(const map::StoredContact back,
                              DecodeContact(stored, "c"));
  EXPECT_EQ(back.links, contact.links);
  ExpectNoCrash(stored, BlobKind::kContact, [](ByteSpan bytes) {
    DecodeContact(bytes, "c").IgnoreError();
  });
}

TEST(ContactCodec, OlderEstimatesComeBackAndTakeAVersionOfTheirOwn) {
  for (const std::size_t count : {std::size_t{1}, map::kOlderEstimates}) {
    for (const bool linked : {false, true}) {
      map::StoredContact contact;
      contact.key = {.source = {"c4i"}, .contact = {"T9"}};
      contact.estimates.resize(1);
      static_cast<map::ContactPoint&>(contact.estimates[0]) =
          SampleContactPoint(3);
      contact.estimates[0].key = contact.key;
      for (std::size_t i = 0; i < count; ++i) {
        contact.older.push_back(SampleContactPoint(static_cast<int>(i)));
      }
      if (linked) {
        contact.links = map::ContactLinks{
            .since = TimeFromUnixMicros(7),
            .names = {{.source = {"ais"}, .contact = {"235000001"}}}};
      }
      const Bytes stored = EncodeContact(contact);
      EXPECT_EQ(stored[1], 4);
      FATHOM_ASSERT_OK_AND_ASSIGN(const map::StoredContact back,
                                  DecodeContact(stored, "c"));
      EXPECT_EQ(back.older, contact.older);
      EXPECT_EQ(back.estimates, contact.estimates);
      EXPECT_EQ(back.links, contact.links);
      ExpectNoCrash(stored, BlobKind::kContact, [](ByteSpan bytes) {
        DecodeContact(bytes, "c").IgnoreError();
      });
    }
  }
}

// A flag that no encoder writes, and a version 4 without what it is for.
TEST(ContactCodec, RefusesWhatIsNoVersionFour) {
  map::StoredContact contact;
  contact.key = {.source = {"radar"}, .contact = {"c"}};
  contact.estimates.resize(1);
  static_cast<map::ContactPoint&>(contact.estimates[0]) = SampleContactPoint(3);
  contact.older.push_back(SampleContactPoint(2));
  const Bytes stored = EncodeContact(contact);
  const auto sealed = [](std::vector<std::uint8_t> payload) {
    ByteWriter writer = StartBlob();
    for (const std::uint8_t byte : payload) writer.PutU8(byte);
    return SealBlob(BlobKind::kContact, 4, std::move(writer));
  };
  std::vector<std::uint8_t> payload(stored.begin() + kBlobHeaderBytes,
                                    stored.end());
  EXPECT_THAT(DecodeContact(sealed(payload), "c"), IsOk());
  // The last byte says whether there are other names.
  ASSERT_EQ(payload.back(), 0);
  payload.back() = 2;
  EXPECT_THAT(DecodeContact(sealed(payload), "c"),
              StatusIs(absl::StatusCode::kDataLoss));
  contact.older.clear();
  const Bytes without = EncodeContact(contact);
  payload.assign(without.begin() + kBlobHeaderBytes, without.end());
  payload.push_back(0);
  payload.push_back(0);
  EXPECT_THAT(DecodeContact(sealed(payload), "c"),
              StatusIs(absl::StatusCode::kDataLoss));
}

TEST(ContactCodec, VersionOneHasNoRecentReports) {
  map::StoredContact contact;
  contact.key = {.source = {"radar"}, .contact = {"c"}};
  contact.estimates.resize(1);
  static_cast<map::ContactPoint&>(contact.estimates[0]) = SampleContactPoint(3);
  contact.estimates[0].key = contact.key;
  const Bytes now = EncodeContact(contact);
  // A version 1 payload ends where version 2 tells its count, 0 here.
  ASSERT_EQ(now.back(), 0);
  ByteWriter writer = StartBlob();
  for (std::size_t i = kBlobHeaderBytes; i + 1 < now.size(); ++i) {
    writer.PutU8(now[i]);
  }
  FATHOM_ASSERT_OK_AND_ASSIGN(
      const map::StoredContact back,
      DecodeContact(SealBlob(BlobKind::kContact, 1, std::move(writer)), "c"));
  EXPECT_EQ(back.estimates, contact.estimates);
  EXPECT_TRUE(back.recent.empty());
}

TEST(ContactCodec, DamageNeverCrashes) {
  map::StoredContact contact;
  contact.key = {.source = {"radar"}, .contact = {"c"}};
  contact.estimates.resize(30);
  for (int i = 0; i < 5; ++i) {
    contact.recent.push_back({.report = SampleReport(i, "c")});
  }
  ExpectNoCrash(EncodeContact(contact), BlobKind::kContact,
                [](ByteSpan blob) { DecodeContact(blob, "c").IgnoreError(); });
}

TEST(ActivityCodec, ActivityComesBack) {
  map::StoredActivity activity;
  activity.start = SampleStart("survey-1");
  activity.start.options.estimator = map::EstimatorKind::kNervegna;
  activity.start.options.default_std_m.reset();
  activity.open = true;
  activity.measurements_accepted = 12345678901234;
  activity.cells_measured = 77;
  activity.rejects.Add(map::RejectReason::kBadStd, 3);
  activity.rejects.Add(map::RejectReason::kContactsFull, 4);
  FATHOM_ASSERT_OK_AND_ASSIGN(const map::StoredActivity back,
                              DecodeActivity(EncodeActivity(activity), "a"));
  EXPECT_EQ(back.start.id, activity.start.id);
  EXPECT_EQ(back.start.vehicle_id, activity.start.vehicle_id);
  EXPECT_EQ(back.start.start, activity.start.start);
  EXPECT_EQ(back.start.options, activity.start.options);
  EXPECT_EQ(back.open, activity.open);
  EXPECT_EQ(back.measurements_accepted, activity.measurements_accepted);
  EXPECT_EQ(back.cells_measured, activity.cells_measured);
  EXPECT_EQ(back.rejects, activity.rejects);
}

TEST(ActivityCodec, DamageNeverCrashes) {
  map::StoredActivity activity;
  activity.start = SampleStart("survey-1");
  ExpectNoCrash(EncodeActivity(activity), BlobKind::kActivity,
                [](ByteSpan blob) { DecodeActivity(blob, "a").IgnoreError(); });
}

std::vector<JournalRecord> SampleJournal(int pings) {
  std::mt19937 random(5);
  std::vector<JournalRecord> records;
  std::uint64_t revision = 1;
  records.push_back({revision++, SampleStart("survey-1")});
  for (int i = 0; i < pings; ++i) {
    records.push_back(
        {revision++,
         PingRecord{.source = {i % 2 == 0 ? "sonar-a" : "sonar-b"},
                    .epoch = 9,
                    .sequence = static_cast<std::uint64_t>(i + 1),
                    .ping = SamplePing(random, "survey-1", i, i % 102)}});
    if (i % 3 == 0) {
      ContactRecord contact{.epoch = 2,
                            .sequence = static_cast<std::uint64_t>(i),
                            .report = SampleReport(i, "ship")};
      if (i % 12 == 3) {
        contact.report.same_as.emplace().push_back(
            {.source = {"ais"}, .contact = {"235000001"}});
      }
      if (i % 12 == 9) {
        contact.report.observation = map::NothingObserved{};
        contact.report.same_as.emplace();
      }
      if (i % 2 == 0) {
        contact.report.observation = map::RangeBearing{
            .pose = {.position = {.latitude_deg = 41, .longitude_deg = -70},
                     .depth_m = 1,
                     .heading_deg = 2,
                     .position_std_m = 3},
            .range_m = 4,
            .bearing_deg = 5,
            .range_std_m = 6,
            .bearing_std_deg = 7};
        contact.report.depth_m = 40;
        contact.report.depth_std_m = 2;
        contact.report.inactive = true;
      }
      records.push_back({revision++, contact});
    }
  }
  records.push_back(
      {revision++,
       map::DropContact{.key = {.source = {"c4i"}, .contact = {"ship"}},
                        .time = TimeFromUnixMicros(17)}});
  return records;
}

void ExpectSameRecord(const JournalRecord& a, const JournalRecord& b) {
  EXPECT_EQ(a.revision, b.revision);
  ASSERT_EQ(a.event.index(), b.event.index());
  if (const auto* ping = std::get_if<PingRecord>(&a.event)) {
    EXPECT_EQ(*ping, std::get<PingRecord>(b.event));
  } else if (const auto* contact = std::get_if<ContactRecord>(&a.event)) {
    EXPECT_EQ(*contact, std::get<ContactRecord>(b.event));
  } else if (const auto* start = std::get_if<map::StartActivity>(&a.event)) {
    const auto& other = std::get<map::StartActivity>(b.event);
    EXPECT_EQ(start->id, other.id);
    EXPECT_EQ(start->vehicle_id, other.vehicle_id);
    EXPECT_EQ(start->start, other.start);
    EXPECT_EQ(start->options, other.options);
  } else {
    const auto& drop = std::get<map::DropContact>(a.event);
    const auto& other = std::get<map::DropContact>(b.event);
    EXPECT_EQ(drop.key, other.key);
    EXPECT_EQ(drop.time, other.time);
  }
}

TEST(JournalCodec, RecordsComeBackInOrderOverSegments) {
  // 3000 pings of 50.5 beams on average are 151 500: three segments of 65 536.
  const std::vector<JournalRecord> records = SampleJournal(3000);
  FATHOM_ASSERT_OK_AND_ASSIGN(const std::vector<JournalSegment> segments,
                              EncodeJournal(records));
  EXPECT_EQ(segments.size(), 3u);
  std::vector<JournalRecord> back;
  for (const JournalSegment& segment : segments) {
    const std::size_t before = back.size();
    ASSERT_THAT(DecodeJournal(segment.content, "segment", back), IsOk());
    EXPECT_EQ(back.size() - before, segment.record_count);
    EXPECT_EQ(back[before].revision, segment.first_revision);
    EXPECT_EQ(back.back().revision, segment.last_revision);
  }
  ASSERT_EQ(back.size(), records.size());
  for (std::size_t i = 0; i < records.size(); ++i) {
    ExpectSameRecord(records[i], back[i]);
  }
}

TEST(JournalCodec, NothingIsNoSegment) {
  FATHOM_ASSERT_OK_AND_ASSIGN(const std::vector<JournalSegment> segments,
                              EncodeJournal({}));
  EXPECT_TRUE(segments.empty());
}

TEST(JournalCodec, PingBeyondItsLimitIsRefused) {
  std::vector<JournalRecord> records(1);
  PingRecord record;
  record.ping.beams.resize(kMaxBeamsPerRecord);
  records[0].event = record;
  EXPECT_THAT(EncodeJournal(records), IsOk());
  record.ping.beams.resize(kMaxBeamsPerRecord + 1);
  records[0].event = record;
  EXPECT_THAT(EncodeJournal(records),
              StatusIs(absl::StatusCode::kInvalidArgument));
}

TEST(JournalCodec, IdBeyondItsLimitIsRefused) {
  std::vector<JournalRecord> records(1);
  PingRecord record;
  record.source.value.assign(kMaxStringBytes + 1, 'x');
  records[0].event = record;
  EXPECT_THAT(EncodeJournal(records),
              StatusIs(absl::StatusCode::kInvalidArgument));
}

TEST(JournalCodec, DamageNeverCrashes) {
  FATHOM_ASSERT_OK_AND_ASSIGN(const std::vector<JournalSegment> segments,
                              EncodeJournal(SampleJournal(20)));
  ASSERT_EQ(segments.size(), 1u);
  ExpectNoCrash(segments[0].content, BlobKind::kJournalSegment,
                [](ByteSpan blob) {
                  std::vector<JournalRecord> records;
                  DecodeJournal(blob, "segment", records).IgnoreError();
                });
}

}  // namespace
}  // namespace fathom::storage
