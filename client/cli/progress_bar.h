// A progress bar with rate and time left on standard error; silent where that
// is no terminal. Thread safety: one thread at a time.

#ifndef FATHOM_CLIENT_CLI_PROGRESS_BAR_H_
#define FATHOM_CLIENT_CLI_PROGRESS_BAR_H_

#include <chrono>
#include <cstdint>
#include <string>

namespace fathom::client::cli {

// The line: "import [=======>      ]  52 %  1.2 M cells/s  3 s left". Pure.
std::string ProgressLine(const std::string& label, const std::string& unit,
                         std::uint64_t done, std::uint64_t total,
                         double elapsed_s);

class ProgressBar {
 public:
  // `total` > 0 of `unit`s ("cells") are to do.
  ProgressBar(std::string label, std::string unit, std::uint64_t total);
  // Ends the line.
  ~ProgressBar();
  ProgressBar(const ProgressBar&) = delete;
  ProgressBar& operator=(const ProgressBar&) = delete;

  // Draws at most ten times a second.
  void Update(std::uint64_t done);
  // Ends the line before other text is written.
  void Finish();

 private:
  const std::string label_;
  const std::string unit_;
  const std::uint64_t total_;
  const bool visible_;
  const std::chrono::steady_clock::time_point start_;
  std::chrono::steady_clock::time_point next_draw_;
  bool drawn_ = false;
};

}  // namespace fathom::client::cli

#endif  // FATHOM_CLIENT_CLI_PROGRESS_BAR_H_
