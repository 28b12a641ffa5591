#include "client/tls.h"

#include <cstdint>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <system_error>

#include "absl/strings/str_format.h"
#include "base/status_macros.h"

namespace fathom::client {
namespace {

// A PEM file's text; "" for no file. Larger ones are no certificates.
constexpr std::uintmax_t kMaxPemBytes = 1 << 20;
absl::StatusOr<std::string> ReadPem(const std::string& path) {
  if (path.empty()) return std::string();
  std::error_code error;
  const std::uintmax_t bytes = std::filesystem::file_size(path, error);
  std::ifstream in(path, std::ios::binary);
  if (error || !in) {
    return absl::NotFoundError(absl::StrFormat("%s: cannot be read", path));
  }
  std::string text;
  if (bytes <= kMaxPemBytes) {
    text.assign(std::istreambuf_iterator<char>(in), {});
  }
  if (text.find("-----BEGIN") == std::string::npos) {
    return absl::InvalidArgumentError(absl::StrFormat(
        "%s: is no PEM file (it would hold -----BEGIN ...)", path));
  }
  return text;
}

}  // namespace

absl::StatusOr<std::shared_ptr<grpc::ChannelCredentials>> TlsCredentials(
    const TlsFiles& files) {
  if (files.ca.empty() && files.cert.empty() && files.key.empty()) {
    return std::shared_ptr<grpc::ChannelCredentials>();
  }
  if (files.cert.empty() != files.key.empty()) {
    return absl::InvalidArgumentError(
        "--tls-cert and --tls-key belong together");
  }
  grpc::SslCredentialsOptions options;
  FATHOM_ASSIGN_OR_RETURN(options.pem_root_certs, ReadPem(files.ca));
  FATHOM_ASSIGN_OR_RETURN(options.pem_cert_chain, ReadPem(files.cert));
  FATHOM_ASSIGN_OR_RETURN(options.pem_private_key, ReadPem(files.key));
  return grpc::SslCredentials(options);
}

}  // namespace fathom::client
