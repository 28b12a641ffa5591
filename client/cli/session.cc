#include "client/cli/session.h"

#include <google/protobuf/util/json_util.h>

#include <cstdio>
#include <utility>

#include "base/clock.h"
#include "client/cli/exit_code.h"

namespace fathom::client::cli {

absl::StatusOr<std::unique_ptr<Client>> Session::Connect() const {
  ClientOptions options;
  if (timeout_s > 0) {
    const std::chrono::milliseconds timeout(
        static_cast<std::int64_t>(timeout_s * 1000));
    options.connect_timeout = timeout;
    options.call_timeout = timeout;
    options.long_call_timeout = timeout;
  }
  absl::StatusOr<std::shared_ptr<grpc::ChannelCredentials>> credentials =
      TlsCredentials(tls);
  if (!credentials.ok()) {
    return tls.cert.empty() != tls.key.empty()
               ? UsageError(credentials.status())
               : FileError(credentials.status());
  }
  options.credentials = *std::move(credentials);
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
