#include "sim_feeder/progress_bar.h"

#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "absl/strings/str_format.h"

namespace fathom::feeder {
namespace {

constexpr std::chrono::milliseconds kRedrawTerminal{100};
constexpr std::chrono::milliseconds kRedrawFile{10'000};
constexpr std::size_t kBarWidth = 20;

}  // namespace

std::string FormatProgress(std::uint64_t done, std::uint64_t total,
                           std::string_view unit, double seconds,
                           const std::string& note) {
  const double part = total == 0
                          ? 1.0
                          : std::min(1.0, static_cast<double>(done) /
                                              static_cast<double>(total));
  const std::size_t filled =
      static_cast<std::size_t>(part * static_cast<double>(kBarWidth));
  const double rate = seconds > 0.0 ? static_cast<double>(done) / seconds : 0.0;
  std::string eta = "-:--";
  if (rate > 0.0 && done <= total) {
    const long long rest_s =
        std::llround(static_cast<double>(total - done) / rate);
    eta = absl::StrFormat("%d:%02d", rest_s / 60, rest_s % 60);
  }
  return absl::StrFormat("[%s%s] %3.0f %%  %d/%d %s  %.0f/s  ETA %s  %s",
                         std::string(filled, '#'),
                         std::string(kBarWidth - filled, '.'), 100.0 * part,
                         done, total, unit, rate, eta, note);
}

ProgressBar::ProgressBar(std::uint64_t total, std::string_view unit,
                         bool enabled)
    : total_(total),
      unit_(unit),
      enabled_(enabled),
      terminal_(isatty(STDERR_FILENO) != 0),
      start_(std::chrono::steady_clock::now()),
      next_(start_) {}

bool ProgressBar::Due() const {
  return enabled_ && std::chrono::steady_clock::now() >= next_;
}

void ProgressBar::Update(std::uint64_t done, const std::string& note) {
  if (!Due()) return;
  next_ = std::chrono::steady_clock::now() +
          (terminal_ ? kRedrawTerminal : kRedrawFile);
  Draw(done, note);
}

void ProgressBar::Finish(std::uint64_t done, const std::string& note) {
  if (!enabled_) return;
  Draw(done, note);
  if (terminal_) std::fputs("\n", stderr);
}

void ProgressBar::Draw(std::uint64_t done, const std::string& note) {
  const double seconds =
      std::chrono::duration<double>(std::chrono::steady_clock::now() - start_)
          .count();
  const std::string line = FormatProgress(done, total_, unit_, seconds, note);
  // Carriage return and "erase to the end of the line" redraw in place.
  std::fputs(
      terminal_ ? ("\r" + line + "\x1b[K").c_str() : (line + "\n").c_str(),
      stderr);
  std::fflush(stderr);
}

}  // namespace fathom::feeder
