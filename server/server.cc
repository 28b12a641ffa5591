#include "server/server.h"

#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <chrono>
#include <cstring>
#include <fstream>
#include <iterator>
#include <utility>

#include "absl/strings/match.h"
#include "absl/strings/str_format.h"
#include "base/log.h"
#include "base/status_macros.h"
#include "grpcpp/ext/proto_server_reflection_plugin.h"
#include "grpcpp/grpcpp.h"
#include "grpcpp/health_check_service_interface.h"
#include "server/health_service.h"
#include "server/ingest_service.h"
#include "server/mission_service.h"
#include "server/obstacle_service.h"

namespace fathom::server {
namespace {

constexpr std::string_view kUnixPrefix = "unix:";

bool IsUnix(std::string_view address) {
  return address.substr(0, kUnixPrefix.size()) == kUnixPrefix;
}

// "127.0.0.1:80" -> "127.0.0.1"; "[::1]:80" -> "::1".
std::string_view HostOf(std::string_view address) {
  const size_t colon = address.rfind(':');
  std::string_view host = address.substr(0, colon);
  if (host.size() >= 2 && host.front() == '[' && host.back() == ']') {
    host = host.substr(1, host.size() - 2);
  }
  return host;
}

absl::StatusOr<std::string> ReadPem(const char* flag, const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  std::string pem{std::istreambuf_iterator<char>(file), {}};
  if (!file.good() && pem.empty()) {
    return absl::InvalidArgumentError(
        absl::StrFormat("%s=%s cannot be read or is empty", flag, path));
  }
  return pem;
}

absl::StatusOr<std::shared_ptr<grpc::ServerCredentials>> Credentials(
    const ListenOptions& options) {
  if (options.tls_cert.empty()) return grpc::InsecureServerCredentials();
  grpc::SslServerCredentialsOptions tls(
      GRPC_SSL_REQUEST_AND_REQUIRE_CLIENT_CERTIFICATE_AND_VERIFY);
  grpc::SslServerCredentialsOptions::PemKeyCertPair pair;
  FATHOM_ASSIGN_OR_RETURN(pair.cert_chain,
                          ReadPem("--tls-cert", options.tls_cert));
  FATHOM_ASSIGN_OR_RETURN(pair.private_key,
                          ReadPem("--tls-key", options.tls_key));
  FATHOM_ASSIGN_OR_RETURN(tls.pem_root_certs,
                          ReadPem("--tls-client-ca", options.tls_client_ca));
  tls.pem_key_cert_pairs.push_back(std::move(pair));
  return grpc::SslServerCredentials(tls);
}

// gRPC removes whatever file is at a Unix socket's path before it binds, a
// living server's too: ask first whether one answers.
absl::Status CheckUnixSocketFree(std::string_view address) {
  const std::string path(address.substr(kUnixPrefix.size()));
  sockaddr_un name{};
  name.sun_family = AF_UNIX;
  if (path.empty() || path.size() >= sizeof(name.sun_path)) {
    return absl::InvalidArgumentError(
        absl::StrFormat("--listen=%s: a socket's path has 1 to %d bytes",
                        address, sizeof(name.sun_path) - 1));
  }
  std::memcpy(name.sun_path, path.data(), path.size());
  const int socket = ::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
  if (socket < 0) return absl::OkStatus();
  const int connected =
      ::connect(socket, reinterpret_cast<const sockaddr*>(&name), sizeof(name));
  ::close(socket);
  if (connected == 0) {
    return absl::FailedPreconditionError(
        absl::StrFormat("%s is in use: another server answers there", address));
  }
  return absl::OkStatus();
}

}  // namespace

bool IsLocalAddress(std::string_view address) {
  if (IsUnix(address)) return true;
  const std::string_view host = HostOf(address);
  // The whole of 127/8 is loopback (RFC 1122, section 3.2.1.3); a name that
  // merely begins with "127." is not.
  if (host.substr(0, 4) == "127.") {
    return host.find_first_not_of("0123456789.") == std::string_view::npos;
  }
  return host == "localhost" || host == "::1";
}

absl::Status CheckListenOptions(const ListenOptions& options) {
  const bool any = !options.tls_cert.empty() || !options.tls_key.empty() ||
                   !options.tls_client_ca.empty();
  const bool all = !options.tls_cert.empty() && !options.tls_key.empty() &&
                   !options.tls_client_ca.empty();
  if (any && !all) {
    return absl::InvalidArgumentError(
        "mutual TLS needs all of --tls-cert, --tls-key and --tls-client-ca");
  }
  if (!IsUnix(options.address) &&
      options.address.find(':') == std::string::npos) {
    return absl::InvalidArgumentError(absl::StrFormat(
        "--listen=%s is neither HOST:PORT nor unix:PATH", options.address));
  }
  if (!all && !IsLocalAddress(options.address)) {
    return absl::InvalidArgumentError(absl::StrFormat(
        "--listen=%s can be reached from other machines; that needs mutual "
        "TLS (--tls-cert, --tls-key, --tls-client-ca). Or listen on "
        "127.0.0.1:PORT or unix:PATH",
        options.address));
  }
  return absl::OkStatus();
}

class Server::Impl {
 public:
  explicit Impl(ServerContext& shared)
      : context(shared), ingest(shared), obstacle(shared), mission(shared) {}

  ServerContext& context;
  IngestService ingest;
  ObstacleService obstacle;
  MissionService mission;
  HealthService health;
  std::string address;
  int port = 0;
  std::unique_ptr<grpc::Server> server;
};

Server::Server(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}

Server::~Server() { Drain(); }

const std::string& Server::address() const { return impl_->address; }

int Server::port() const { return impl_->port; }

absl::StatusOr<std::unique_ptr<Server>> Server::Start(
    const ListenOptions& options, ServerContext& context) {
  FATHOM_RETURN_IF_ERROR(CheckListenOptions(options));
  FATHOM_ASSIGN_OR_RETURN(auto credentials, Credentials(options));
  if (IsUnix(options.address)) {
    FATHOM_RETURN_IF_ERROR(CheckUnixSocketFree(options.address));
  }
  auto impl = std::make_unique<Impl>(context);
  // Ours is an ordinary service, so that reflection lists it.
  grpc::EnableDefaultHealthCheckService(false);
  grpc::reflection::InitProtoReflectionServerBuilderPlugin();
  grpc::ServerBuilder builder;
  builder.AddListeningPort(options.address, credentials, &impl->port);
  // Without this two servers would share a port and split the calls.
  builder.AddChannelArgument(GRPC_ARG_ALLOW_REUSEPORT, 0);
  builder.AddChannelArgument(GRPC_ARG_MAX_CONCURRENT_STREAMS,
                             kMaxStreamsPerConnection);
  builder.AddChannelArgument(
      GRPC_ARG_KEEPALIVE_TIME_MS,
      static_cast<int>(std::chrono::milliseconds(kKeepaliveTime).count()));
  builder.AddChannelArgument(
      GRPC_ARG_KEEPALIVE_TIMEOUT_MS,
      static_cast<int>(std::chrono::milliseconds(kKeepaliveTimeout).count()));
  builder.AddChannelArgument(GRPC_ARG_KEEPALIVE_PERMIT_WITHOUT_CALLS, 1);
  builder.SetResourceQuota(
      grpc::ResourceQuota("fathomd").Resize(kMaxTransportBytes));
  builder.SetMaxReceiveMessageSize(kMaxMessageBytes);
  // Answers are bounded by our limits, not by gRPC's.
  builder.SetMaxSendMessageSize(-1);
  builder.RegisterService(&impl->ingest);
  builder.RegisterService(&impl->obstacle);
  builder.RegisterService(&impl->mission);
  builder.RegisterService(&impl->health);
  impl->server = builder.BuildAndStart();
  if (impl->server == nullptr || (impl->port == 0)) {
    return absl::FailedPreconditionError(absl::StrFormat(
        "cannot listen on %s: the address is in use by another program or "
        "not one of this machine",
        options.address));
  }
  if (IsUnix(options.address)) {
    impl->address = options.address;
    impl->port = 0;
  } else {
    impl->address = absl::StrFormat(
        "%s:%d", options.address.substr(0, options.address.rfind(':')),
        impl->port);
  }
  return std::unique_ptr<Server>(new Server(std::move(impl)));
}

void Server::Drain() {
  if (impl_->server == nullptr) return;
  impl_->context.draining = true;
  impl_->health.SetNotServing();
  impl_->context.ingest_calls.Drain();
  impl_->context.import_calls.Drain();
  impl_->context.changes.WakeAll();
  impl_->context.keeper.StopWaiting();
  impl_->server->Shutdown(std::chrono::system_clock::now() + kDrainTime);
  impl_->server->Wait();
  impl_->server.reset();
}

}  // namespace fathom::server
