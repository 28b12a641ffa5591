// The messages of a simulation, the first of them made before any is sent.
//
// A ping costs more to simulate than to send. Who loads a server - flat out, or
// open loop at a rate near that - makes messages ahead, so that it is the
// server and the link that are measured; nothing of them is freed while it is
// sent. Not thread-safe.

#ifndef FATHOM_SIM_FEEDER_PREPARED_MESSAGES_H_
#define FATHOM_SIM_FEEDER_PREPARED_MESSAGES_H_

#include <cstddef>
#include <cstdint>
#include <deque>
#include <optional>
#include <variant>

#include "fathom/v1/ingest_service.pb.h"
#include "sim_feeder/simulation.h"

namespace fathom::feeder {

class PreparedMessages {
 public:
  // Makes messages of `bytes` as they are sent together (in memory about twice
  // that), or all of them. `simulation` must outlive this.
  PreparedMessages(Simulation& simulation, std::uint64_t bytes);

  const Simulation& simulation() const { return simulation_; }

  // As Simulation::Next: first what was made ahead, then what is made now.
  std::optional<Simulation::Message> Next();

  // Of the last message: its time since the start, seconds, and the ping times
  // that were over.
  double now_s() const { return now_s_; }
  std::uint64_t pings_done() const { return pings_done_; }

 private:
  struct Made {
    std::variant<v1::Ping, v1::ContactReport> message;
    double at_s;
    std::uint64_t pings_done;
  };

  Simulation& simulation_;
  std::deque<Made> made_;
  std::size_t given_ = 0;
  double now_s_ = 0.0;
  std::uint64_t pings_done_ = 0;
};

}  // namespace fathom::feeder

#endif  // FATHOM_SIM_FEEDER_PREPARED_MESSAGES_H_
