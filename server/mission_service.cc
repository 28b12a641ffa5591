#include "server/mission_service.h"

#include <chrono>
#include <filesystem>
#include <functional>
#include <string_view>
#include <utility>

#include "absl/strings/str_format.h"
#include "server/convert_common.h"
#include "server/convert_mission.h"
#include "server/field_checks.h"
#include "server/import_call.h"

namespace fathom::server {
namespace {

grpc::ServerUnaryReactor* Reply(grpc::CallbackServerContext* call,
                                const absl::Status& status) {
  grpc::ServerUnaryReactor* reactor = call->DefaultReactor();
  reactor->Finish(ToGrpc(status));
  return reactor;
}

// A `done` for the keeper that answers the call: `write` fills the response
// from the result. The answer is sent by the courier.
template <typename Result, typename Write>
Done<Result> Answer(ServerContext& context, grpc::ServerUnaryReactor* reactor,
                    Write write) {
  return [&context, reactor, write](absl::StatusOr<Applied<Result>> applied) {
    if (applied.ok()) write(*applied);
    context.courier.Give([&context, reactor, status = applied.status()] {
      reactor->Finish(ToGrpc(KeeperError(context, status)));
    });
  };
}

absl::Status CheckActivityId(const std::string& id) {
  const FieldPath root;
  return CheckId(id, FieldPath(root, "activity_id"));
}

// Of StorageStatus.damage.
constexpr int kMaxDamageTold = 100;

// A name in the mission's own folder that neither hides nor stands for what
// belongs to a mission (docs/storage_format.md, "Files").
absl::Status CheckFileName(const std::string& name, const FieldPath& path) {
  if (name.empty() || name.size() > kMaxNameLength || name.front() == '.' ||
      name.find_first_of(std::string_view("/\0", 2)) != std::string::npos) {
    return InvalidField(
        path.ToString(),
        absl::StrFormat("must be a file name of 1 to %d bytes without "
                        "directories that does not begin with a dot",
                        kMaxNameLength));
  }
  for (const std::string_view end : {"-wal", "-shm", ".lock", ".new"}) {
    if (std::string_view(name).ends_with(end)) {
      return InvalidField(path.ToString(),
                          absl::StrFormat("ends in %s, which stands for a part "
                                          "of a mission",
                                          end));
    }
  }
  return absl::OkStatus();
}

double SecondsSince(std::chrono::steady_clock::time_point start) {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start)
      .count();
}

}  // namespace

grpc::ServerUnaryReactor* MissionService::StartActivity(
    grpc::CallbackServerContext* call, const v1::StartActivityRequest* request,
    v1::StartActivityResponse* response) {
  auto event = ConvertStart(*request, context_.clock.Now());
  if (!event.ok()) return Reply(call, event.status());
  grpc::ServerUnaryReactor* reactor = call->DefaultReactor();
  const map::ActivityId id = event->id;
  context_.keeper.StartActivity(
      *std::move(event),
      Answer<Nothing>(context_, reactor,
                      [this, id, response](const Applied<Nothing>& applied) {
                        response->set_map_revision(applied.revision);
                        const auto view = context_.keeper.View();
                        if (const auto* activity = view->FindActivity(id)) {
                          WriteActivity(*activity,
                                        response->mutable_activity());
                        }
                      }));
  return reactor;
}

grpc::ServerUnaryReactor* MissionService::CompleteActivity(
    grpc::CallbackServerContext* call,
    const v1::CompleteActivityRequest* request,
    v1::CompleteActivityResponse* response) {
  const absl::Status checked = CheckActivityId(request->activity_id());
  if (!checked.ok()) return Reply(call, checked);
  grpc::ServerUnaryReactor* reactor = call->DefaultReactor();
  const auto start = std::chrono::steady_clock::now();
  context_.keeper.CompleteActivity(
      {request->activity_id()}, request->discard(),
      Answer<map::TransferResult>(
          context_, reactor,
          [start, response](const Applied<map::TransferResult>& applied) {
            WriteTransfer(applied.result, SecondsSince(start),
                          response->mutable_transfer());
            response->set_map_revision(applied.revision);
          }));
  return reactor;
}

grpc::ServerUnaryReactor* MissionService::TransferLocalMap(
    grpc::CallbackServerContext* call,
    const v1::TransferLocalMapRequest* request,
    v1::TransferLocalMapResponse* response) {
  const absl::Status checked = CheckActivityId(request->activity_id());
  if (!checked.ok()) return Reply(call, checked);
  grpc::ServerUnaryReactor* reactor = call->DefaultReactor();
  const auto start = std::chrono::steady_clock::now();
  context_.keeper.Transfer(
      {request->activity_id()},
      Answer<map::TransferResult>(
          context_, reactor,
          [start, response](const Applied<map::TransferResult>& applied) {
            WriteTransfer(applied.result, SecondsSince(start),
                          response->mutable_transfer());
            response->set_map_revision(applied.revision);
          }));
  return reactor;
}

grpc::ServerReadReactor<v1::ImportPriorRequest>* MissionService::ImportPrior(
    grpc::CallbackServerContext*, v1::ImportPriorResponse* response) {
  return ImportCall::Start(context_, response);
}

grpc::ServerUnaryReactor* MissionService::GetImport(
    grpc::CallbackServerContext* call, const v1::GetImportRequest* request,
    v1::GetImportResponse* response) {
  const FieldPath root;
  const absl::Status checked =
      CheckId(request->import_id(), FieldPath(root, "import_id"));
  if (!checked.ok()) return Reply(call, checked);
  grpc::ServerUnaryReactor* reactor = call->DefaultReactor();
  context_.keeper.FindImport(
      request->import_id(),
      Answer<uint64_t>(context_, reactor,
                       [response](const Applied<uint64_t>& applied) {
                         response->set_tiles(applied.result);
                       }));
  return reactor;
}

grpc::ServerUnaryReactor* MissionService::GetMissionStatus(
    grpc::CallbackServerContext* call,
    const v1::GetMissionStatusRequest* request,
    v1::GetMissionStatusResponse* response) {
  const storage::MissionMetadata& metadata = context_.file.metadata();
  const auto view = context_.keeper.View();
  response->set_mission_id(metadata.mission_id);
  response->set_name(metadata.name);
  response->set_vertical_datum(metadata.vertical_datum);
  WriteTime(metadata.created, response->mutable_created_time());
  response->set_server_version(FATHOM_VERSION);
  WriteStamp(*view, response->mutable_stamp());
  response->set_uptime_s(SecondsSince(context_.start));
  WriteActivities(*view, response->mutable_activities());

  v1::GlobalMapStatus* global = response->mutable_global_map();
  const map::GlobalMapView& map = view->global();
  const map::RootSquare& root = map.root();
  WritePoint(root.south_west(), global->mutable_south_west());
  WritePoint(root.north_west(), global->mutable_north_west());
  global->set_max_level(static_cast<uint32_t>(root.max_level()));
  global->set_min_cell_m(root.cell_size_m(root.max_level()));
  global->set_leaves(map.known_leaf_count());
  global->set_max_cells(metadata.max_cells);
  global->set_degraded(view->counters().degraded);
  const map::TileUse use = map.tile_use();
  global->set_memory_bytes(use.memory_bytes);
  global->set_tile_budget_bytes(use.budget_bytes);
  global->set_unpacked_bytes(use.unpacked_bytes);
  global->set_packed_bytes(use.packed_bytes);
  global->set_unpacked_tiles(use.unpacked_tiles);
  global->set_packed_tiles(use.packed_tiles);
  global->set_tolerance_m(metadata.tolerance_m);

  v1::ContactListStatus* contacts = response->mutable_contacts();
  contacts->set_live(view->contacts().live_count());
  contacts->set_dropped(view->contacts().size() -
                        view->contacts().live_count());
  contacts->set_max_contacts(metadata.max_contacts);
  WriteRejects(view->counters().contact_rejects, contacts->mutable_rejects());
  WriteContactClasses(view->contacts().classes(), contacts);
  const auto live = static_cast<double>(view->contacts().live_count());
  if (live >= kContactsWarning * static_cast<double>(metadata.max_contacts)) {
    contacts->set_warning(absl::StrFormat(
        "%d of max_contacts=%d are live: drop contacts that are gone, or new "
        "ones will be refused",
        view->contacts().live_count(), metadata.max_contacts));
  }

  v1::StorageStatus* storage = response->mutable_storage();
  const storage::MissionFileStatus file = context_.file.Status();
  const StorageState state = context_.keeper.storage_state();
  storage->set_file_bytes(file.file_bytes);
  storage->set_wal_bytes(file.wal_bytes);
  storage->set_journal_records(state.journal_records);
  storage->set_durable_revision(state.durable_revision);
  storage->set_fault(state.fault);
  v1::ContactHistoryStatus* history = storage->mutable_contact_history();
  history->set_estimates(file.history.estimates);
  history->set_bytes(file.history.bytes());
  history->set_forgotten_estimates(file.history.forgotten_estimates);
  if (file.history_limits.max_age.has_value()) {
    history->set_max_age_s(ToSeconds(*file.history_limits.max_age));
  }
  if (file.history_limits.max_bytes.has_value()) {
    history->set_max_bytes(*file.history_limits.max_bytes);
  }
  if (file.log_starved) {
    storage->set_warning(absl::StrFormat(
        "the write-ahead log has %d MiB: a long read (verify, save) keeps it "
        "from being copied; it shrinks when that ends",
        file.wal_bytes >> 20));
  }
  for (const std::string& damage : context_.damage) {
    if (storage->damage_size() >= kMaxDamageTold) break;
    storage->add_damage(damage);
  }
  WriteLimits(response->mutable_limits());
  if (!request->with_digest()) return Reply(call, absl::OkStatus());
  // Reads the whole map: not on a thread that other calls need.
  grpc::ServerUnaryReactor* reactor = call->DefaultReactor();
  context_.workers.Give([reactor, response, view] {
    response->set_map_digest(view->Digest());
    reactor->Finish(grpc::Status::OK);
  });
  return reactor;
}

grpc::ServerUnaryReactor* MissionService::DropContact(
    grpc::CallbackServerContext* call, const v1::DropContactRequest* request,
    v1::DropContactResponse* response) {
  auto event = ConvertDrop(*request, context_.clock.Now());
  if (!event.ok()) return Reply(call, event.status());
  grpc::ServerUnaryReactor* reactor = call->DefaultReactor();
  context_.keeper.DropContact(
      *std::move(event),
      Answer<Nothing>(context_, reactor,
                      [response](const Applied<Nothing>& applied) {
                        response->set_map_revision(applied.revision);
                      }));
  return reactor;
}

grpc::ServerUnaryReactor* MissionService::SaveMission(
    grpc::CallbackServerContext* call, const v1::SaveMissionRequest* request,
    v1::SaveMissionResponse* response) {
  const FieldPath root;
  const absl::Status checked =
      CheckFileName(request->file_name(), FieldPath(root, "file_name"));
  if (!checked.ok()) return Reply(call, checked);
  return WorkOnFile(call, [this, response, name = request->file_name()] {
    const std::filesystem::path mission(context_.file.path());
    absl::StatusOr<storage::SavedCopy> copy =
        context_.file.SaveCopy(mission.parent_path() / name);
    if (!copy.ok()) return copy.status();
    response->set_file_bytes(copy->bytes);
    response->set_map_revision(copy->revision);
    response->set_map_digest(std::move(copy->digest));
    return absl::OkStatus();
  });
}

grpc::ServerUnaryReactor* MissionService::VerifyMission(
    grpc::CallbackServerContext* call, const v1::VerifyMissionRequest*,
    v1::VerifyMissionResponse* response) {
  return WorkOnFile(call, [this, response] {
    absl::StatusOr<storage::Proof> proof = context_.file.Verify();
    if (!proof.ok()) return proof.status();
    response->set_ok(proof->problems.empty());
    response->set_map_digest(std::move(proof->digest));
    for (std::string& problem : proof->problems) {
      response->add_problems(std::move(problem));
    }
    return absl::OkStatus();
  });
}

template <typename Job>
grpc::ServerUnaryReactor* MissionService::WorkOnFile(
    grpc::CallbackServerContext* call, Job job) {
  if (!context_.file_calls.Take()) {
    return Reply(call, TooManyCalls("calls of SaveMission or VerifyMission",
                                    context_.file_calls.limit()));
  }
  grpc::ServerUnaryReactor* reactor = call->DefaultReactor();
  context_.workers.Give([this, reactor, job] {
    const absl::Status status = job();
    context_.file_calls.GiveBack();
    reactor->Finish(ToGrpc(status));
  });
  return reactor;
}

}  // namespace fathom::server
