#include "client/cli/answer_text.h"

#include "absl/strings/str_format.h"
#include "client/cli/text.h"

namespace fathom::client::cli {

std::string ReasonsText(const v1::ObstacleAnswer& answer) {
  std::string text;
  if (answer.has_seabed()) {
    const v1::StaticEvidence& seabed = answer.seabed();
    if (seabed.kind() == v1::EVIDENCE_KIND_LAND) {
      text += "  seabed    land";
    } else {
      absl::StrAppendFormat(&text, "  seabed    %.2f m +- %.2f m, %s",
                            seabed.depth_m(), seabed.std_m(),
                            KindText(seabed.kind()));
    }
    const bool local = seabed.layer() == v1::MAP_LAYER_LOCAL;
    absl::StrAppendFormat(
        &text, ", %s map%s, %.4g m cell", local ? "local" : "global",
        local ? " of " + seabed.activity_id() : "", seabed.cell_size_m());
    if (seabed.has_age_s()) {
      absl::StrAppendFormat(&text, ", %s old", SpanText(seabed.age_s()));
    }
    if (seabed.has_shoalest_m()) {
      absl::StrAppendFormat(&text, "; shoalest sounding %.2f m",
                            seabed.shoalest_m());
    }
    absl::StrAppendFormat(&text, "; P = %.6g\n", seabed.probability());
  } else {
    text += "  seabed    unknown: neither measured nor charted\n";
  }
  for (const v1::ContactEvidence& contact : answer.contacts()) {
    absl::StrAppendFormat(
        &text, "  contact   %s/%s: %.1f m away, reported %s before; P = %.6g\n",
        contact.source_id(), contact.contact_id(), contact.distance_m(),
        SpanText(contact.age_s()), contact.probability());
  }
  return text;
}

std::string StampText(const v1::MapStamp& stamp) {
  return absl::StrFormat("  map       revision %d, as of %s\n",
                         stamp.map_revision(), TimeText(stamp.as_of()));
}

}  // namespace fathom::client::cli
