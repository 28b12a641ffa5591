#include "map/contacts/contact_report.h"

#include <algorithm>
#include <cmath>

namespace fathom::map {
namespace {

bool InRange(double value, double low, double high) {
  return value >= low && value <= high;
}

// 1 sigma in (0, most]. NaN and infinity were told apart before.
bool IsStd(double value, double most) { return value > 0.0 && value <= most; }

std::optional<RejectReason> CheckPosition(const GeodeticPoint& position) {
  if (!std::isfinite(position.latitude_deg) ||
      !std::isfinite(position.longitude_deg)) {
    return RejectReason::kNotFinite;
  }
  if (!ValidateGeodetic(position).ok()) return RejectReason::kInvalidMessage;
  if (std::fabs(position.latitude_deg) > kMaxContactLatitudeDeg) {
    return RejectReason::kOutsideArea;
  }
  return std::nullopt;
}

std::optional<RejectReason> Check(const RangeBearing& heard) {
  if (!std::isfinite(heard.range_m) || !std::isfinite(heard.bearing_deg) ||
      !std::isfinite(heard.range_std_m) ||
      !std::isfinite(heard.bearing_std_deg) ||
      !std::isfinite(heard.pose.heading_deg) ||
      !std::isfinite(heard.pose.position_std_m)) {
    return RejectReason::kNotFinite;
  }
  if (const auto reason = CheckPosition(heard.pose.position)) return reason;
  if (heard.range_m <= 0.0) return RejectReason::kBelowMinRange;
  if (heard.range_m > kMaxContactRangeM) return RejectReason::kAboveMaxRange;
  if (!IsStd(heard.range_std_m, kMaxContactStdM) ||
      !IsStd(heard.bearing_std_deg, kMaxBearingStdDeg) ||
      !InRange(heard.pose.position_std_m, 0.0, kMaxContactStdM)) {
    return RejectReason::kBadStd;
  }
  return std::nullopt;
}

std::optional<RejectReason> Check(const ContactFix& fix) {
  if (!std::isfinite(fix.velocity_north_m_s) ||
      !std::isfinite(fix.velocity_east_m_s) ||
      !std::isfinite(fix.position_std_m) ||
      !std::isfinite(fix.velocity_std_m_s)) {
    return RejectReason::kNotFinite;
  }
  if (const auto reason = CheckPosition(fix.position)) return reason;
  if (std::fabs(fix.velocity_north_m_s) > kMaxContactSpeedMPerS ||
      std::fabs(fix.velocity_east_m_s) > kMaxContactSpeedMPerS) {
    return RejectReason::kInvalidMessage;
  }
  if (!InRange(fix.position_std_m, 0.0, kMaxContactStdM) ||
      !InRange(fix.velocity_std_m_s, 0.0, kMaxContactVelocityStdMPerS)) {
    return RejectReason::kBadStd;
  }
  return std::nullopt;
}

std::optional<RejectReason> Check(const NothingObserved&) {
  return std::nullopt;
}

// What a report says of names, whatever is known of them.
std::optional<RejectReason> CheckLinks(const ContactReport& report) {
  const bool nothing =
      std::holds_alternative<NothingObserved>(report.observation);
  if (!report.same_as.has_value()) {
    if (nothing && !report.inactive) return RejectReason::kInvalidMessage;
    return std::nullopt;
  }
  if (report.inactive ||
      std::holds_alternative<RangeBearing>(report.observation)) {
    return RejectReason::kInvalidMessage;
  }
  const std::vector<ContactKey>& names = *report.same_as;
  if (names.size() > kMaxLinkedNames) return RejectReason::kBadLink;
  for (auto name = names.begin(); name != names.end(); ++name) {
    if (*name == report.key || std::find(names.begin(), name, *name) != name) {
      return RejectReason::kBadLink;
    }
  }
  return std::nullopt;
}

}  // namespace

std::optional<RejectReason> CheckContactReport(const ContactReport& report) {
  if (!IsContactClass(report.contact_class)) {
    return RejectReason::kInvalidMessage;
  }
  if (const auto reason = CheckLinks(report)) return reason;
  if (report.inactive) return std::nullopt;
  if (report.depth_m.has_value()) {
    if (!std::isfinite(*report.depth_m)) return RejectReason::kNotFinite;
    if (!InRange(*report.depth_m, kMinContactDepthM, kMaxContactDepthM)) {
      return RejectReason::kBadDepth;
    }
  }
  if (report.depth_std_m.has_value()) {
    if (!std::isfinite(*report.depth_std_m)) return RejectReason::kNotFinite;
    if (!IsStd(*report.depth_std_m, kMaxContactStdM)) {
      return RejectReason::kBadStd;
    }
  }
  return std::visit([](const auto& seen) { return Check(seen); },
                    report.observation);
}

}  // namespace fathom::map
