// Certificates of a link, from files. Thread-safe.

#ifndef FATHOM_CLIENT_TLS_H_
#define FATHOM_CLIENT_TLS_H_

#include <grpcpp/security/credentials.h>

#include <memory>
#include <string>

#include "absl/status/statusor.h"

namespace fathom::client {

// PEM files. Any of them: TLS instead of plain text. `cert` and `key` are
// ours, where the server asks who we are; `ca` signs the server's (empty: the
// system's authorities).
struct TlsFiles {
  std::string ca = {};
  std::string cert = {};
  std::string key = {};
};

// For ClientOptions::credentials; null where no file is named. Errors:
// INVALID_ARGUMENT (a certificate without its key, a file that is no PEM),
// NOT_FOUND (a file that cannot be read).
absl::StatusOr<std::shared_ptr<grpc::ChannelCredentials>> TlsCredentials(
    const TlsFiles& files);

}  // namespace fathom::client

#endif  // FATHOM_CLIENT_TLS_H_
