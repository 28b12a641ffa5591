#include "map/geodesy/ping.h"

namespace fathom::map {

std::string_view RejectReasonName(RejectReason reason) {
  switch (reason) {
    case RejectReason::kNotFinite:
      return "NOT_FINITE";
    case RejectReason::kBelowMinRange:
      return "BELOW_MIN_RANGE";
    case RejectReason::kAboveMaxRange:
      return "ABOVE_MAX_RANGE";
    case RejectReason::kBadStd:
      return "BAD_STD";
    case RejectReason::kOutsideArea:
      return "OUTSIDE_AREA";
    case RejectReason::kBadDepth:
      return "BAD_DEPTH";
    case RejectReason::kInvalidMessage:
      return "INVALID_MESSAGE";
    case RejectReason::kNoActivity:
      return "NO_ACTIVITY";
    case RejectReason::kGated:
      return "GATED";
    case RejectReason::kTooLate:
      return "TOO_LATE";
    case RejectReason::kContactsFull:
      return "CONTACTS_FULL";
    case RejectReason::kBadLink:
      return "BAD_LINK";
  }
  return "?";
}

}  // namespace fathom::map
