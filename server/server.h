// Server: the gRPC side of fathomd. Binds, serves the three services of
// fathom.v1 with health and reflection, and drains.
//
// Who may connect: a loopback address or a Unix socket is open to the
// machine's own users; any other address needs mutual TLS, because gRPC 1.51
// has known HTTP/2 denial-of-service faults that only a known peer should be
// able to reach.

#ifndef FATHOM_SERVER_SERVER_H_
#define FATHOM_SERVER_SERVER_H_

#include <memory>
#include <string>
#include <string_view>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "server/server_context.h"

namespace fathom::server {

// Where and for whom to listen.
struct ListenOptions {
  // "HOST:PORT" (port 0: any free one) or "unix:PATH".
  std::string address = "127.0.0.1:7430";
  // PEM files; all three or none.
  std::string tls_cert = "";
  std::string tls_key = "";
  std::string tls_client_ca = "";
};

// Whether the address is reached from this machine only.
bool IsLocalAddress(std::string_view address);

// Refuses an address that others can reach without mutual TLS, and half a TLS
// configuration. Errors: INVALID_ARGUMENT saying which flags to give.
absl::Status CheckListenOptions(const ListenOptions& options);

// See file comment. Destroying it cuts what Drain has not ended.
class Server {
 public:
  // Binds and serves. `context` must outlive the server. Errors:
  // INVALID_ARGUMENT (CheckListenOptions, files that cannot be read),
  // FAILED_PRECONDITION (the address is in use or cannot be bound).
  static absl::StatusOr<std::unique_ptr<Server>> Start(
      const ListenOptions& options, ServerContext& context);

  ~Server();
  Server(const Server&) = delete;
  Server& operator=(const Server&) = delete;

  // The address in use, with the port that was taken.
  const std::string& address() const;
  // 0 for a Unix socket.
  int port() const;

  // Health says NOT_SERVING, no new call is taken, streams end when what they
  // sent is durable; what has not ended after kDrainTime is cut. The keeper
  // must still run. Idempotent.
  void Drain();

 private:
  class Impl;
  explicit Server(std::unique_ptr<Impl> impl);

  std::unique_ptr<Impl> impl_;
};

}  // namespace fathom::server

#endif  // FATHOM_SERVER_SERVER_H_
