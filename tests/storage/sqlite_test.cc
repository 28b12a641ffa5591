#include "storage/sqlite.h"

#include <gtest/gtest.h>

#include <fstream>
#include <limits>

#include "tests/storage/temp_dir.h"
#include "tests/testing/status_matchers.h"

namespace fathom::storage {
namespace {

using ::fathom::testing::IsOk;
using ::fathom::testing::IsOkAndHolds;
using ::fathom::testing::StatusIs;
using ::testing::ElementsAre;

class SqliteTest : public ::testing::Test {
 protected:
  void SetUp() override {
    auto opened = Connection::Open(dir_.File("db"), Connection::Mode::kCreate);
    ASSERT_THAT(opened, IsOk());
    connection_ = *std::move(opened);
    ASSERT_THAT(connection_.Execute("CREATE TABLE t (a INTEGER PRIMARY KEY, "
                                    "b TEXT, c BLOB, d REAL) STRICT"),
                IsOk());
  }

  TempDir dir_;
  Connection connection_;
};

TEST_F(SqliteTest, BoundValuesComeBack) {
  FATHOM_ASSERT_OK_AND_ASSIGN(
      Statement insert, connection_.Prepare("INSERT INTO t VALUES (?,?,?,?)"));
  const Bytes blob = {0, 255};
  insert.BindUint(0, std::numeric_limits<std::uint64_t>::max());
  insert.BindText(1, std::string_view("a\0b", 3));
  insert.BindBlob(2, blob);
  insert.BindReal(3, 0.1);
  ASSERT_THAT(insert.Run(), IsOk());
  FATHOM_ASSERT_OK_AND_ASSIGN(Statement select,
                              connection_.Prepare("SELECT a, b, c, d FROM t"));
  ASSERT_THAT(select.Step(), IsOkAndHolds(true));
  EXPECT_EQ(select.ColumnUint(0), std::numeric_limits<std::uint64_t>::max());
  EXPECT_EQ(select.ColumnText(1), std::string("a\0b", 3));
  EXPECT_THAT(select.ColumnBlob(2), ElementsAre(0, 255));
  EXPECT_EQ(select.ColumnReal(3), 0.1);
  EXPECT_THAT(select.Step(), IsOkAndHolds(false));
}

TEST_F(SqliteTest, EmptyTextAndBlobAreNotNull) {
  FATHOM_ASSERT_OK_AND_ASSIGN(
      Statement insert,
      connection_.Prepare("INSERT INTO t (a, b, c) VALUES (1, ?, ?)"));
  insert.BindText(0, std::string_view());
  insert.BindBlob(1, ByteSpan());
  ASSERT_THAT(insert.Run(), IsOk());
  EXPECT_THAT(connection_.QueryInt(
                  "SELECT count(*) FROM t WHERE b IS NULL OR c IS NULL"),
              IsOkAndHolds(0));
}

TEST_F(SqliteTest, TransactionThatIsNotCommittedLeavesNothing) {
  {
    FATHOM_ASSERT_OK_AND_ASSIGN(const Transaction transaction,
                                Transaction::Begin(connection_));
    ASSERT_THAT(connection_.Execute("INSERT INTO t (a) VALUES (1)"), IsOk());
  }
  EXPECT_THAT(connection_.QueryInt("SELECT count(*) FROM t"), IsOkAndHolds(0));
}

TEST_F(SqliteTest, ErrorsHaveTheCodesOfTheHeader) {
  EXPECT_THAT(connection_.Execute("NONSENSE"),
              StatusIs(absl::StatusCode::kInvalidArgument));
  ASSERT_THAT(connection_.Execute("INSERT INTO t (a) VALUES (1)"), IsOk());
  EXPECT_THAT(connection_.Execute("INSERT INTO t (a) VALUES (1)"),
              StatusIs(absl::StatusCode::kFailedPrecondition));
  FATHOM_ASSERT_OK_AND_ASSIGN(
      Connection reader,
      Connection::Open(dir_.File("db"), Connection::Mode::kReadOnly));
  EXPECT_THAT(reader.Execute("DELETE FROM t"),
              StatusIs(absl::StatusCode::kFailedPrecondition));
  std::ofstream(dir_.File("text")) << std::string(4096, 'x');
  FATHOM_ASSERT_OK_AND_ASSIGN(
      Connection text,
      Connection::Open(dir_.File("text"), Connection::Mode::kReadOnly));
  EXPECT_THAT(text.QueryInt("SELECT count(*) FROM t"),
              StatusIs(absl::StatusCode::kDataLoss));
}

TEST_F(SqliteTest, FullDatabaseIsResourceExhaustedAndUndone) {
  ASSERT_THAT(connection_.Execute("PRAGMA max_page_count = 4"), IsOk());
  EXPECT_THAT(
      connection_.Execute("INSERT INTO t (a, c) VALUES (1, zeroblob(100000))"),
      StatusIs(absl::StatusCode::kResourceExhausted));
  EXPECT_THAT(connection_.QueryInt("SELECT count(*) FROM t"), IsOkAndHolds(0));
}

}  // namespace
}  // namespace fathom::storage
