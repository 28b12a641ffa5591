#include "server/import_call.h"

#include <utility>

#include "base/log.h"
#include "base/status_macros.h"
#include "server/errors.h"
#include "server/field_checks.h"

namespace fathom::server {

ImportCall* ImportCall::Start(ServerContext& context,
                              v1::ImportPriorResponse* response) {
  auto call = std::make_shared<ImportCall>(context, response);
  call->self_ = call;
  ImportCall* const reactor = call.get();
  if (!context.import_calls.Add(call)) {
    reactor->Finish(
        ToGrpc(TooManyCalls("imports", context.import_calls.limit())));
  } else {
    reactor->StartRead(&reactor->request_);
  }
  return reactor;
}

void ImportCall::OnReadDone(bool ok) {
  if (!ok) {
    if (!header_.has_value()) {
      Fail(HeaderMissing());
    } else if (!held_.has_value()) {
      // A chart without tiles changes nothing; a resumed one that was complete
      // is made durable.
      FinishWithoutTiles();
    } else {
      Import(*std::exchange(held_, std::nullopt), /*last=*/true);
    }
    return;
  }
  std::optional<map::RasterBlock> due = std::exchange(held_, std::nullopt);
  const absl::Status taken = TakeRequest();
  if (!taken.ok()) {
    Fail(taken);
  } else if (due.has_value()) {
    Import(*std::move(due), /*last=*/false);
  } else {
    StartRead(&request_);
  }
}

absl::Status ImportCall::TakeRequest() {
  const FieldPath root;
  switch (request_.part_case()) {
    case v1::ImportPriorRequest::kHeader: {
      if (header_.has_value()) return HeaderMissing();
      FATHOM_ASSIGN_OR_RETURN(
          header_, ConvertHeader(request_.header(), FieldPath(root, "header")));
      return absl::OkStatus();
    }
    case v1::ImportPriorRequest::kTile: {
      if (!header_.has_value()) return HeaderMissing();
      FATHOM_ASSIGN_OR_RETURN(held_, ConvertTile(request_.tile(), *header_,
                                                 FieldPath(root, "tile")));
      cells_ += held_->depth_m.size();
      if (cells_ > kMaxImportCells) {
        return LimitExceeded("cells of the chart", cells_, kMaxImportCells);
      }
      return absl::OkStatus();
    }
    case v1::ImportPriorRequest::PART_NOT_SET:
      return Missing(FieldPath(root, "part"), "header or tile");
  }
  return Missing(FieldPath(root, "part"), "header or tile");
}

void ImportCall::Import(map::RasterBlock block, bool last) {
  auto done = [call = shared_from_this(),
               last](absl::StatusOr<Applied<ImportedTile>> applied) {
    call->context_.courier.Give([call, last, applied = std::move(applied)] {
      if (!applied.ok()) {
        call->Fail(KeeperError(call->context_, applied.status()));
        return;
      }
      const map::ImportResult& result = applied->result.result;
      v1::ImportPriorResponse* const response = call->response_;
      response->set_tiles(response->tiles() + 1);
      response->set_map_revision(applied->revision);
      if (applied->result.skipped) {
        response->set_tiles_skipped(response->tiles_skipped() + 1);
      } else {
        if (!call->any_applied_) {
          response->set_leaves_before(result.leaves_before);
        }
        call->any_applied_ = true;
        response->set_leaves_after(result.leaves_after);
      }
      response->set_cells_with_depth(response->cells_with_depth() +
                                     result.cells_with_depth);
      response->set_cells_land(response->cells_land() + result.cells_land);
      response->set_cells_unknown(response->cells_unknown() +
                                  result.cells_unknown);
      response->set_cells_outside(response->cells_outside() +
                                  result.cells_outside);
      response->set_degraded(response->degraded() + result.degraded);
      if (!last) {
        call->StartRead(&call->request_);
        return;
      }
      Log(LogLevel::kInfo,
          "chart imported name=%s import_id=%s tiles=%d skipped=%d leaves=%d",
          call->header_->name, call->header_->import_id, response->tiles(),
          response->tiles_skipped(), response->leaves_after());
      call->Finish(grpc::Status::OK);
    });
  };
  const uint64_t number = header_->first_tile + tiles_++;
  context_.keeper.Import(std::move(block), last,
                         {.import_id = header_->import_id, .number = number},
                         std::move(done));
}

void ImportCall::FinishWithoutTiles() {
  context_.keeper.Checkpoint([call = shared_from_this()](
                                 const absl::StatusOr<Applied<Nothing>>& done) {
    call->context_.courier.Give([call, done] {
      if (!done.ok()) {
        call->Fail(KeeperError(call->context_, done.status()));
        return;
      }
      call->response_->set_map_revision(done->revision);
      call->Finish(grpc::Status::OK);
    });
  });
}

void ImportCall::Fail(const absl::Status& status) {
  if (any_applied_) {
    Log(LogLevel::kWarning, "chart import broke off name=%s: %s", header_->name,
        std::string(status.message()));
    context_.keeper.Checkpoint([](const absl::StatusOr<Applied<Nothing>>&) {});
  }
  Finish(ToGrpc(status));
}

}  // namespace fathom::server
