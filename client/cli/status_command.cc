// fathom status: the mission at a glance.

#include <memory>

#include "absl/strings/str_format.h"
#include "base/status_macros.h"
#include "client/cli/session.h"
#include "client/cli/text.h"

namespace fathom::client::cli {
namespace {

std::string Summary(const v1::GetMissionStatusResponse& s) {
  const v1::GlobalMapStatus& map = s.global_map();
  const v1::StorageStatus& storage = s.storage();
  std::string text;
  absl::StrAppendFormat(&text, "mission     %s  (%s, datum %s)\n", s.name(),
                        s.mission_id(), s.vertical_datum());
  absl::StrAppendFormat(&text, "server      %s, up %s\n", s.server_version(),
                        SpanText(s.uptime_s()));
  absl::StrAppendFormat(&text, "map         revision %s, newest evidence %s\n",
                        CountText(s.stamp().map_revision()),
                        TimeText(s.stamp().as_of()));
  if (!s.map_digest().empty()) {
    absl::StrAppendFormat(&text, "digest      %s\n", s.map_digest());
  }
  absl::StrAppendFormat(
      &text,
      "global map  %s of %s leaves, %s, cells from %.4g m, tolerance "
      "%.3g m\n",
      CountText(map.leaves()), CountText(map.max_cells()),
      BytesText(map.memory_bytes()), map.min_cell_m(), map.tolerance_m());
  if (map.packed_tiles() > 0) {
    absl::StrAppendFormat(
        &text, "            %s of %s tiles packed in %s; unpacked %s of %s\n",
        CountText(map.packed_tiles()),
        CountText(map.packed_tiles() + map.unpacked_tiles()),
        BytesText(map.packed_bytes()), BytesText(map.unpacked_bytes()),
        BytesText(map.tile_budget_bytes()));
  }
  if (map.degraded() > 0) {
    absl::StrAppendFormat(
        &text, "            %s updates went to a coarser leaf (map full)\n",
        CountText(map.degraded()));
  }
  absl::StrAppendFormat(&text, "area        SW %s  NW %s\n",
                        PlaceText(map.south_west()),
                        PlaceText(map.north_west()));
  absl::StrAppendFormat(&text, "contacts    %d live of %d, %d dropped\n",
                        s.contacts().live(), s.contacts().max_contacts(),
                        s.contacts().dropped());
  if (!s.contacts().warning().empty()) {
    absl::StrAppendFormat(&text, "            warning: %s\n",
                          s.contacts().warning());
  }
  absl::StrAppendFormat(
      &text, "storage     %s + %s log, journal %s, durable to revision %s%s\n",
      BytesText(storage.file_bytes()), BytesText(storage.wal_bytes()),
      CountText(storage.journal_records()),
      CountText(storage.durable_revision()),
      storage.fault().empty() ? "" : "\n  FAULT     " + storage.fault());
  if (!storage.warning().empty()) {
    absl::StrAppendFormat(&text, "            warning: %s\n",
                          storage.warning());
  }
  const v1::ContactHistoryStatus& history = storage.contact_history();
  absl::StrAppendFormat(
      &text, "history     %s estimates of contacts, %s%s\n",
      CountText(history.estimates()), BytesText(history.bytes()),
      history.forgotten_estimates() == 0
          ? ""
          : "; " + CountText(history.forgotten_estimates()) + " forgotten");
  absl::StrAppendFormat(&text, "activities  %d\n", s.activities_size());
  for (const v1::ActivityStatus& a : s.activities()) {
    absl::StrAppendFormat(
        &text,
        "  %-16s %-6s %s of %s cells measured, %s "
        "measurements, refused: %s\n",
        a.activity_id(), a.open() ? "open" : "ended",
        CountText(a.cells_measured()),
        CountText(std::uint64_t{a.cells_north()} * a.cells_east()),
        CountText(a.measurements_accepted()), RejectsText(a.rejects()));
  }
  return text;
}

absl::Status Run(const Session& session, bool digest) {
  FATHOM_ASSIGN_OR_RETURN(const std::unique_ptr<Client> client,
                          session.Connect());
  v1::GetMissionStatusRequest request;
  request.set_with_digest(digest);
  FATHOM_ASSIGN_OR_RETURN(const v1::GetMissionStatusResponse status,
                          client->GetMissionStatus(request));
  if (session.json) {
    PrintJson(ToJson(status));
  } else {
    Print(Summary(status));
  }
  return absl::OkStatus();
}

}  // namespace

void AddStatus(CLI::App& app, Session& session) {
  CLI::App* verb = app.add_subcommand(
      "status", "The mission at a glance: map, activities, contacts, file");
  const auto digest = std::make_shared<bool>(false);
  verb->add_flag("--digest", *digest,
                 "Also compute the digest of the whole map: equal digests "
                 "mean equal maps (reads all of it, about 1 s per 50 M "
                 "cells)");
  verb->footer(
      "\nExamples:\n  fathom status\n"
      "  fathom status --json | jq .global_map.leaves");
  verb->callback([&session, digest]() {
    session.run = [&session, digest]() { return Run(session, *digest); };
  });
}

}  // namespace fathom::client::cli
