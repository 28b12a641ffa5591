#include "client/cli/text.h"

#include <array>
#include <cctype>
#include <cmath>
#include <string_view>

#include "absl/strings/str_format.h"
#include "client/proto_time.h"

namespace fathom::client::cli {
namespace {

// "CONTACT_CLASS_SMALL_CRAFT" without "CONTACT_CLASS_", in lower case.
std::string Short(const std::string& name, std::string_view prefix) {
  std::string text =
      name.starts_with(prefix) ? name.substr(prefix.size()) : name;
  for (char& c : text) c = static_cast<char>(std::tolower(c));
  return text;
}

}  // namespace

std::string PlaceText(const v1::GeodeticPoint& point) {
  return absl::StrFormat("%.5f %c, %.5f %c", std::abs(point.latitude_deg()),
                         point.latitude_deg() < 0 ? 'S' : 'N',
                         std::abs(point.longitude_deg()),
                         point.longitude_deg() < 0 ? 'W' : 'E');
}

std::string SpanText(double seconds) {
  if (seconds < 120) return absl::StrFormat("%.3g s", seconds);
  if (seconds < 7200) return absl::StrFormat("%.1f min", seconds / 60);
  if (seconds < 172'800) return absl::StrFormat("%.1f h", seconds / 3600);
  return absl::StrFormat("%.1f d", seconds / 86'400);
}

std::string BytesText(std::uint64_t bytes) {
  constexpr std::array<const char*, 4> kUnits = {"KB", "MB", "GB", "TB"};
  if (bytes < 1024) return absl::StrFormat("%d B", bytes);
  double amount = static_cast<double>(bytes) / 1024;
  std::size_t unit = 0;
  while (amount >= 1024 && unit + 1 < kUnits.size()) {
    amount /= 1024;
    ++unit;
  }
  return absl::StrFormat("%.1f %s", amount, kUnits[unit]);
}

std::string CountText(std::uint64_t count) {
  std::string text = absl::StrFormat("%d", count);
  for (std::size_t from_end = 3; from_end < text.size(); from_end += 4) {
    text.insert(text.size() - from_end, " ");
  }
  return text;
}

std::string TimeText(const google::protobuf::Timestamp& time) {
  if (time.seconds() == 0 && time.nanos() == 0) return "never";
  return FormatTime(FromProto(time));
}

std::string StateText(v1::ObstacleState state) {
  std::string text = Short(v1::ObstacleState_Name(state), "OBSTACLE_STATE_");
  for (char& c : text) c = static_cast<char>(std::toupper(c));
  return text;
}

std::string KindText(v1::EvidenceKind kind) {
  return kind == v1::EVIDENCE_KIND_UNSPECIFIED
             ? "none"
             : Short(v1::EvidenceKind_Name(kind), "EVIDENCE_KIND_");
}

std::string ClassText(v1::ContactClass contact_class) {
  return Short(v1::ContactClass_Name(contact_class), "CONTACT_CLASS_");
}

std::string StatusText(v1::ContactStatus status) {
  return Short(v1::ContactStatus_Name(status), "CONTACT_STATUS_");
}

std::string EstimatorText(v1::Estimator estimator) {
  return Short(v1::Estimator_Name(estimator), "ESTIMATOR_");
}

std::string RejectsText(
    const google::protobuf::RepeatedPtrField<v1::RejectCount>& rejects) {
  std::string text;
  for (const v1::RejectCount& reject : rejects) {
    if (reject.count() == 0) continue;
    absl::StrAppendFormat(
        &text, "%s%s %s", text.empty() ? "" : ", ", CountText(reject.count()),
        Short(v1::RejectReason_Name(reject.reason()), "REJECT_REASON_"));
  }
  return text.empty() ? "none" : text;
}

bool ClassFromText(const std::string& text, v1::ContactClass* contact_class) {
  for (int i = v1::ContactClass_MIN; i <= v1::ContactClass_MAX; ++i) {
    const auto candidate = static_cast<v1::ContactClass>(i);
    if (v1::ContactClass_IsValid(i) &&
        candidate != v1::CONTACT_CLASS_UNSPECIFIED &&
        ClassText(candidate) == text) {
      *contact_class = candidate;
      return true;
    }
  }
  return false;
}

}  // namespace fathom::client::cli
