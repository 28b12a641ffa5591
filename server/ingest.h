// What goes into the keeper from a source and what it says back.
//
// Plain values and one interface; no gRPC.

#ifndef FATHOM_SERVER_INGEST_H_
#define FATHOM_SERVER_INGEST_H_

#include <cstddef>
#include <cstdint>
#include <string>
#include <variant>

#include "map/contacts/contact_report.h"
#include "map/geodesy/ids.h"
#include "map/geodesy/ping.h"
#include "server/source_ledger.h"

namespace fathom::server {

// A message that failed validation but has a number: it takes its place in
// the order, so that the numbers behind it are not reported missing.
struct Refusal {
  map::RejectReason reason = map::RejectReason::kInvalidMessage;
  // Path of the offending field; empty if the map itself refused.
  std::string field;
  // What was wrong and what to do, for people.
  std::string description;
};

// One numbered message of a source.
struct IngestMessage {
  StreamKind kind = StreamKind::kPings;
  map::SourceId source;
  MessageNumber number;
  // REQUIRES: a Ping in kPings, a ContactReport in kContacts, or a Refusal.
  std::variant<map::Ping, map::ContactReport, Refusal> content;
};

// What became of it.
enum class MessageFate { kApplied, kDuplicate, kRefused };

struct MessageOutcome {
  MessageNumber number;
  MessageFate fate = MessageFate::kApplied;
  // A view of at least this revision shows the message.
  uint64_t revision = 0;
  // Measurements fused (pings), else 0.
  uint32_t accepted = 0;
  // Measurements refused, by reason.
  map::RejectCounts rejects;
  // With kRefused: why.
  Refusal refusal;
  // Numbers that never came before this one.
  MissingNumbers missing = {};
};

// Who sent messages: hears what becomes of them. The keeper holds a reference
// while messages are under way, so it may be called after its stream ended.
//
// OnApplied runs on the mapper thread, OnDurable on the storage thread, OnRoom
// and OnFault on either: implementations lock for themselves, return quickly
// and never call the keeper from OnApplied or OnDurable.
class IngestListener {
 public:
  virtual ~IngestListener() = default;

  // One message was applied, found to be a duplicate or refused; the view
  // that shows it is published. Called in the order of submission.
  virtual void OnApplied(const MessageOutcome& outcome) = 0;

  // `count` further messages, `newest` the last of them, survive a power cut.
  // Called in order, once for each group commit that held any of them.
  virtual void OnDurable(MessageNumber newest, size_t count) = 0;

  // There is room again after Submit said Room::kNone.
  virtual void OnRoom() = 0;

  // The mission file takes no more for now; what is not durable yet becomes
  // so later or not at all. Called once, to listeners with work under way.
  virtual void OnFault() = 0;
};

}  // namespace fathom::server

#endif  // FATHOM_SERVER_INGEST_H_
