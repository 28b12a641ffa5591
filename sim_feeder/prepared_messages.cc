#include "sim_feeder/prepared_messages.h"

namespace fathom::feeder {

PreparedMessages::PreparedMessages(Simulation& simulation, std::uint64_t bytes)
    : simulation_(simulation) {
  std::uint64_t held = 0;
  while (held < bytes) {
    const std::optional<Simulation::Message> message = simulation_.Next();
    if (!message.has_value()) return;
    std::visit(
        [&](const auto* made) {
          held += made->ByteSizeLong();
          made_.push_back({.message = *made,
                           .at_s = simulation_.now_s(),
                           .pings_done = simulation_.pings_done()});
        },
        *message);
  }
}

std::optional<Simulation::Message> PreparedMessages::Next() {
  if (given_ == made_.size()) {
    const std::optional<Simulation::Message> message = simulation_.Next();
    now_s_ = simulation_.now_s();
    pings_done_ = simulation_.pings_done();
    return message;
  }
  Made& made = made_[given_++];
  now_s_ = made.at_s;
  pings_done_ = made.pings_done;
  return std::visit(
      [](auto& message) -> Simulation::Message { return &message; },
      made.message);
}

}  // namespace fathom::feeder
