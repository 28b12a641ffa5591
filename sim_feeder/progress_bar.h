// One line on standard error that says how far a run is.
//
//   [##########..........]  50 %  2000/4000 pings  8210/s  ETA 0:12  ...
//
// On a terminal the line is redrawn ten times a second; elsewhere a line is
// printed every 10 s. Not thread-safe.

#ifndef FATHOM_SIM_FEEDER_PROGRESS_BAR_H_
#define FATHOM_SIM_FEEDER_PROGRESS_BAR_H_

#include <chrono>
#include <cstdint>
#include <string>
#include <string_view>

namespace fathom::feeder {

// The line, for `done` of `total` `unit` after `seconds`; `note` ends it.
std::string FormatProgress(std::uint64_t done, std::uint64_t total,
                           std::string_view unit, double seconds,
                           const std::string& note);

class ProgressBar {
 public:
  // Draws nothing if not `enabled`. `unit`, a literal: what is counted.
  ProgressBar(std::uint64_t total, std::string_view unit, bool enabled);

  // Whether Update would draw now: lets the caller skip composing a note.
  bool Due() const;
  void Update(std::uint64_t done, const std::string& note);
  // Draws the last state and ends the line.
  void Finish(std::uint64_t done, const std::string& note);

 private:
  void Draw(std::uint64_t done, const std::string& note);

  const std::uint64_t total_;
  const std::string_view unit_;
  const bool enabled_;
  const bool terminal_;
  const std::chrono::steady_clock::time_point start_;
  std::chrono::steady_clock::time_point next_;
};

}  // namespace fathom::feeder

#endif  // FATHOM_SIM_FEEDER_PROGRESS_BAR_H_
