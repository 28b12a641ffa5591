// Which calls the client repeats by itself: every one of the contract that is
// harmless twice, and no other. The server fails each call's first attempts,
// whatever the method.

#include <gmock/gmock.h>
#include <grpcpp/generic/async_generic_service.h>
#include <grpcpp/security/server_credentials.h>
#include <grpcpp/server.h>
#include <grpcpp/server_builder.h>
#include <gtest/gtest.h>

#include <atomic>
#include <functional>
#include <memory>
#include <set>
#include <string>

#include "absl/strings/str_cat.h"
#include "base/mutex.h"
#include "client/client.h"
#include "tests/testing/status_matchers.h"

namespace fathom::client {
namespace {

using ::fathom::testing::IsOk;
using ::fathom::testing::StatusIs;

// Answers any call: its first `fail` attempts with UNAVAILABLE, the next with
// one empty message.
class AnyCallServer final : public grpc::CallbackGenericService {
 public:
  AnyCallServer() {
    int port = 0;
    grpc::ServerBuilder builder;
    builder.AddListeningPort("127.0.0.1:0", grpc::InsecureServerCredentials(),
                             &port);
    builder.RegisterCallbackGenericService(this);
    server_ = builder.BuildAndStart();
    address_ = absl::StrCat("127.0.0.1:", port);
  }
  ~AnyCallServer() override { server_->Shutdown(); }

  const std::string& address() const { return address_; }
  void Fail(int attempts) {
    fail_ = attempts;
    attempts_ = 0;
  }
  int attempts() const { return attempts_; }
  // Address and port of each connection that brought a call.
  std::set<std::string> peers() const {
    const MutexLock lock(mutex_);
    return peers_;
  }

  grpc::ServerGenericBidiReactor* CreateReactor(
      grpc::GenericCallbackServerContext* context) override {
    const MutexLock lock(mutex_);
    peers_.insert(context->peer());
    return new Call(++attempts_ > fail_);
  }

 private:
  // One attempt: reads the request, then answers or fails.
  class Call final : public grpc::ServerGenericBidiReactor {
   public:
    explicit Call(bool succeed) : succeed_(succeed) { StartRead(&request_); }
    void OnReadDone(bool) override {
      if (succeed_) {
        StartWriteAndFinish(&answer_, {}, grpc::Status::OK);
      } else {
        Finish(grpc::Status(grpc::StatusCode::UNAVAILABLE, "starting"));
      }
    }
    void OnDone() override { delete this; }

   private:
    const bool succeed_;
    grpc::ByteBuffer request_;
    const grpc::Slice nothing_;
    const grpc::ByteBuffer answer_{&nothing_, 1};
  };

  std::unique_ptr<grpc::Server> server_;
  std::string address_;
  std::atomic<int> fail_ = 0;
  std::atomic<int> attempts_ = 0;
  mutable Mutex mutex_;
  std::set<std::string> peers_ FATHOM_GUARDED_BY(mutex_);
};

class Retry : public ::testing::Test {
 protected:
  void SetUp() override {
    FATHOM_ASSERT_OK_AND_ASSIGN(client_,
                                Client::Connect(server_.address(), {}));
  }

  AnyCallServer server_;
  std::unique_ptr<Client> client_;
};

struct NamedCall {
  const char* name;
  std::function<absl::Status(const Client&)> call;
};

TEST_F(Retry, WhatIsHarmlessTwiceIsAskedAgainUntilItSucceeds) {
  const NamedCall calls[] = {
      {"QueryObstacle", [](auto& c) { return c.QueryObstacle({}).status(); }},
      {"QueryObstacles", [](auto& c) { return c.QueryObstacles({}).status(); }},
      {"CheckTrajectory",
       [](auto& c) { return c.CheckTrajectory({}).status(); }},
      {"FindNearestObstacle",
       [](auto& c) { return c.FindNearestObstacle({}).status(); }},
      {"ListContacts", [](auto& c) { return c.ListContacts({}).status(); }},
      {"GetContactHistory",
       [](auto& c) { return c.GetContactHistory({}).status(); }},
      {"ReportContacts", [](auto& c) { return c.ReportContacts({}).status(); }},
      {"GetMissionStatus",
       [](auto& c) { return c.GetMissionStatus().status(); }},
      {"GetImport", [](auto& c) { return c.GetImport("id").status(); }},
      {"VerifyMission", [](auto& c) { return c.VerifyMission().status(); }},
  };
  for (const NamedCall& named : calls) {
    server_.Fail(1);
    EXPECT_THAT(named.call(*client_), IsOk()) << named.name;
    EXPECT_EQ(server_.attempts(), 2) << named.name;
  }
  // An empty grid is none, but it was asked for twice.
  server_.Fail(1);
  EXPECT_FALSE(client_->GetRegion({}).ok());
  EXPECT_EQ(server_.attempts(), 2);
}

TEST_F(Retry, WhatCouldChangeTheMapTwiceIsSentOnce) {
  const NamedCall calls[] = {
      {"StartActivity", [](auto& c) { return c.StartActivity({}).status(); }},
      {"CompleteActivity",
       [](auto& c) { return c.CompleteActivity({}).status(); }},
      {"TransferLocalMap",
       [](auto& c) { return c.TransferLocalMap({}).status(); }},
      {"SaveMission", [](auto& c) { return c.SaveMission({}).status(); }},
      {"DropContact", [](auto& c) { return c.DropContact({}).status(); }},
  };
  for (const NamedCall& named : calls) {
    server_.Fail(1);
    EXPECT_THAT(named.call(*client_), StatusIs(absl::StatusCode::kUnavailable))
        << named.name;
    EXPECT_EQ(server_.attempts(), 1) << named.name;
  }
}

TEST_F(Retry, AServerThatStaysAwayIsGivenUpAfterTheStatedAttempts) {
  server_.Fail(kMaxAttempts);
  EXPECT_THAT(client_->CheckTrajectory({}),
              StatusIs(absl::StatusCode::kUnavailable));
  EXPECT_EQ(server_.attempts(), kMaxAttempts);
}

TEST_F(Retry, AllCallsOfAClientShareOneConnection) {
  server_.Fail(0);
  for (int i = 0; i < 10; ++i) {
    ASSERT_THAT(client_->QueryObstacle({}), IsOk());
    ASSERT_THAT(client_->GetMissionStatus(), IsOk());
    ASSERT_THAT(client_->ReportContacts({}), IsOk());
  }
  EXPECT_THAT(server_.peers(), ::testing::SizeIs(1));
}

}  // namespace
}  // namespace fathom::client
