// ImportCall: one ImportPrior call. Takes a header, then tiles, one at a time:
// the next is read when the last is in the map, so a chart of any size costs
// two tiles of memory and pings pass in between. The last tile is held back
// until the client has ended, because with it the import becomes durable.
//
// A broken-off import leaves the tiles that were taken in the map (and makes
// them durable): with an import_id it may be repeated or resumed, each tile
// counts once; without one, repeat it with `replace`.
//
// Reactions and the keeper's answers alternate, so the state needs no mutex:
// at any time either a read or a command is under way.

#ifndef FATHOM_SERVER_IMPORT_CALL_H_
#define FATHOM_SERVER_IMPORT_CALL_H_

#include <cstdint>
#include <memory>
#include <optional>

#include "absl/status/status.h"
#include "fathom/v1/mission_service.pb.h"
#include "grpcpp/support/server_callback.h"
#include "map/global/raster_block.h"
#include "server/call_registry.h"
#include "server/convert_mission.h"
#include "server/server_context.h"

namespace fathom::server {

// See file comment.
class ImportCall final : public grpc::ServerReadReactor<v1::ImportPriorRequest>,
                         public LongCall,
                         public std::enable_shared_from_this<ImportCall> {
 public:
  // The reactor for one call; it deletes itself.
  static ImportCall* Start(ServerContext& context,
                           v1::ImportPriorResponse* response);

  ImportCall(ServerContext& context, v1::ImportPriorResponse* response)
      : context_(context), response_(response) {}

  void OnReadDone(bool ok) override;
  void OnDone() override { self_.reset(); }
  // An import is short beside the drain time: it may finish.
  void Drain() override {}

 private:
  // Checks request_; a tile replaces held_, which is then due.
  absl::Status TakeRequest();
  // Hands `block` to the map; then reads on, or finishes after the last.
  void Import(map::RasterBlock block, bool last);
  void FinishWithoutTiles();
  void Fail(const absl::Status& status);

  ServerContext& context_;
  v1::ImportPriorResponse* const response_;
  v1::ImportPriorRequest request_;
  std::optional<ChartHeader> header_;
  std::optional<map::RasterBlock> held_;
  // Tiles handed to the map.
  uint64_t tiles_ = 0;
  uint64_t cells_ = 0;
  bool any_applied_ = false;
  std::shared_ptr<ImportCall> self_;
};

}  // namespace fathom::server

#endif  // FATHOM_SERVER_IMPORT_CALL_H_
