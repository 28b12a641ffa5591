#include "client/cli/contact_text.h"

#include <cmath>
#include <limits>

#include "absl/strings/str_format.h"
#include "client/cli/text.h"

namespace fathom::client::cli {

std::string ContactRow(const v1::ContactEstimate& c) {
  // Covariance: nn, ne, n.vn, n.ve, ee, ... (types.proto).
  const double position_std_m =
      c.covariance_size() == 10
          ? std::sqrt((c.covariance(0) + c.covariance(4)) / 2)
          : std::numeric_limits<double>::quiet_NaN();
  double course_deg =
      std::atan2(c.velocity_east_m_s(), c.velocity_north_m_s()) * 180 / M_PI;
  if (course_deg < 0) course_deg += 360;
  return absl::StrFormat(
      "%-24s %-12s %-8s %-24s %6.1f %4.1f  %5.0f  %7d  %s\n",
      c.source_id() + "/" + c.contact_id(), ClassText(c.contact_class()),
      StatusText(c.status()), PlaceText(c.position()), position_std_m,
      std::hypot(c.velocity_north_m_s(), c.velocity_east_m_s()), course_deg,
      c.report_count(), TimeText(c.time()));
}

}  // namespace fathom::client::cli
