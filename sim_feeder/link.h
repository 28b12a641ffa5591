// The way from the feeder to a server: where it is, who we are, and what
// happens while it is away.

#ifndef FATHOM_SIM_FEEDER_LINK_H_
#define FATHOM_SIM_FEEDER_LINK_H_

#include <cstdint>
#include <memory>
#include <string>

#include "absl/status/statusor.h"
#include "client/client.h"
#include "client/tls.h"
#include "sim_feeder/message_sink.h"

namespace fathom::feeder {

struct LinkOptions {
  // host:port or unix:/path. Empty: no server (a dry run).
  std::string server = {};
  client::TlsFiles tls = {};
  std::string source_id = "feeder";
  // 0: the wall clock, which is larger than every epoch before.
  std::uint64_t epoch = 0;
  // How long the server may be away, or make nothing durable, before the run
  // gives up, seconds; with a buffer: at its end alone.
  double patience_s = 30.0;
  // Not empty: messages go to this folder first (client/buffered_stream.h).
  std::string buffer = {};
  // Its size for pings, and for reports, MiB.
  std::uint64_t buffer_mib = 256;
};

// Errors: as client::TlsCredentials and client::Client::Connect. With
// `may_be_away` it does not wait for the server.
absl::StatusOr<std::unique_ptr<client::Client>> Connect(
    const LinkOptions& link, bool may_be_away = false);

// Where the messages of a run go. `paced`: they come as they happen and cannot
// wait for room in a full buffer. Errors: as the streams' Open.
absl::StatusOr<std::unique_ptr<MessageSink>> OpenSink(
    const client::Client& client, const LinkOptions& link, bool paced);

// `fathom-feeder send`: what a run left in a buffer, to the server. Tells
// people on standard error what it was. Errors: NOT_FOUND (no buffer there),
// and as BufferedStream::Finish.
absl::Status SendBuffered(LinkOptions link);

}  // namespace fathom::feeder

#endif  // FATHOM_SIM_FEEDER_LINK_H_
