#include "client/cli/session.h"

#include <google/protobuf/util/json_util.h>

#include <cstdio>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <system_error>

#include "absl/strings/str_format.h"
#include "base/clock.h"
#include "base/status_macros.h"
#include "client/cli/exit_code.h"

namespace fathom::client::cli {
namespace {

// A PEM file's text; "" for no file. Larger ones are no certificates.
constexpr std::uintmax_t kMaxPemBytes = 1 << 20;
absl::StatusOr<std::string> ReadPem(const std::string& path) {
  if (path.empty()) return std::string();
  std::error_code error;
  const std::uintmax_t bytes = std::filesystem::file_size(path, error);
  std::ifstream in(path, std::ios::binary);
  if (error || !in) {
    return FileError(
        absl::NotFoundError(absl::StrFormat("%s: cannot be read", path)));
  }
  std::string text;
  if (bytes <= kMaxPemBytes) {
    text.assign(std::istreambuf_iterator<char>(in), {});
  }
  if (text.find("-----BEGIN") == std::string::npos) {
    return FileError(absl::InvalidArgumentError(absl::StrFormat(
        "%s: is no PEM file (it would hold -----BEGIN ...)", path)));
  }
  return text;
}

absl::StatusOr<std::shared_ptr<grpc::ChannelCredentials>> TlsCredentials(
    const Session& session) {
  if (session.tls_cert.empty() != session.tls_key.empty()) {
    return UsageError(
        absl::InvalidArgumentError("--tls-cert and --tls-key belong together"));
  }
  grpc::SslCredentialsOptions options;
  FATHOM_ASSIGN_OR_RETURN(options.pem_root_certs, ReadPem(session.tls_ca));
  FATHOM_ASSIGN_OR_RETURN(options.pem_cert_chain, ReadPem(session.tls_cert));
  FATHOM_ASSIGN_OR_RETURN(options.pem_private_key, ReadPem(session.tls_key));
  return grpc::SslCredentials(options);
}

}  // namespace

absl::StatusOr<std::unique_ptr<Client>> Session::Connect() const {
  ClientOptions options;
  if (timeout_s > 0) {
    const std::chrono::milliseconds timeout(
        static_cast<std::int64_t>(timeout_s * 1000));
    options.connect_timeout = timeout;
    options.call_timeout = timeout;
    options.long_call_timeout = timeout;
  }
  if (!tls_ca.empty() || !tls_cert.empty() || !tls_key.empty()) {
    FATHOM_ASSIGN_OR_RETURN(options.credentials, TlsCredentials(*this));
  }
  return Client::Connect(server, options);
}

Time Session::Now() const { return SystemClock().Now(); }

nlohmann::ordered_json ToJson(const google::protobuf::Message& message) {
  google::protobuf::util::JsonPrintOptions options;
  options.always_print_primitive_fields = true;
  options.preserve_proto_field_names = true;
  std::string text;
  if (!google::protobuf::util::MessageToJsonString(message, &text, options)
           .ok()) {
    return nlohmann::ordered_json::object();
  }
  return nlohmann::ordered_json::parse(text);
}

void PrintJson(const nlohmann::ordered_json& document) {
  const auto replace = nlohmann::ordered_json::error_handler_t::replace;
  Print(document.dump(2, ' ', false, replace) + "\n");
}

void PrintJsonLine(const nlohmann::ordered_json& document) {
  const auto replace = nlohmann::ordered_json::error_handler_t::replace;
  Print(document.dump(-1, ' ', false, replace) + "\n");
  std::fflush(stdout);
}

void Print(const std::string& text) {
  std::fwrite(text.data(), 1, text.size(), stdout);
}

void Note(const std::string& text) {
  std::fprintf(stderr, "%s\n", text.c_str());
}

}  // namespace fathom::client::cli
