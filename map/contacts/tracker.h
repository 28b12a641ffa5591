// What one report makes of one track: gate, filter, beginning anew. A pure
// function, so that a track can be made again from any point of its reports
// (ContactMap does when an earlier report comes late).
//
// A report about a tracked contact passes the innovation gate or is refused
// (kGated) and counted:
// - a range and bearing, if its normalised innovation squared is <= kGateNis
//   either north and east or in range and bearing: each is bent where the
//   other is straight, and a true report is an outlier in one of them at most;
// - a fix, "the truth" (thesis 5.2) and so not held against the prediction, if
//   the contact can have got there: kGateSigmas of both places and of its
//   class's first velocity.
//
// One report that is refused changes nothing that is answered. If the next
// report is refused as well and fits to it (the same gate, about a track that
// the refused one would have begun), the two are right and the track was wrong
// or has manoeuvred: the track begins anew from both. If they do not fit the
// newer one is remembered in the other's place. So a false track is left after
// two reports, and two outliers are believed only when they agree.
//
// Thread-safe: no state.

#ifndef FATHOM_MAP_CONTACTS_TRACKER_H_
#define FATHOM_MAP_CONTACTS_TRACKER_H_

#include <array>
#include <cstddef>
#include <optional>

#include "map/contacts/contact.h"
#include "map/contacts/contact_class.h"
#include "map/contacts/contact_report.h"
#include "map/contacts/filter.h"
#include "map/geodesy/ping.h"

namespace fathom::map {

// chi^2 with 2 degrees of freedom is above it once in 270 000 times: 5 sigma.
inline constexpr double kGateNis = 25;
inline constexpr double kGateSigmas = 5;

// What is known of a contact before a report.
struct TrackMemory {
  // Its newest estimate; nullptr: never reported.
  const ContactPoint* newest = nullptr;
  // The report before, if the gate refused it; else nullptr.
  const ContactReport* gated = nullptr;
};

// What came of a report.
struct TrackStep {
  // The points that follow, in order: none if refused, or if the contact was
  // gone already and is said to be; two if the track began anew.
  std::array<ContactPoint, 2> points;
  std::size_t count = 0;
  // kGated, kNotFinite, kOutsideArea; nullopt: taken.
  std::optional<RejectReason> refused;
  // Normalised innovation squared, north and east, of a range and bearing
  // about a contact that was tracked; chi^2 with 2 degrees of freedom if all
  // is as believed. Told of a gated one too.
  std::optional<double> nis;
};

// REQUIRES: CheckContactReport(report) is nullopt; report.time not before
// memory's. About 0.4 us.
TrackStep Step(const TrackMemory& memory, const ContactReport& report,
               FilterKind filter, const ContactClassTable& classes);

// The marker that closes a track, at `time` or its newest estimate's time.
ContactPoint DropPoint(const ContactPoint& newest, Time time,
                       const ContactClassTable& classes);

// Whether every number of it is finite.
bool IsFinite(const ContactPoint& point);

}  // namespace fathom::map

#endif  // FATHOM_MAP_CONTACTS_TRACKER_H_
